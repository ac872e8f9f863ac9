// What a station saw: the zenith in the middle, the horizon around, north up and east right.

class Sky {
  constructor(tab, box, spec) {
    Object.assign(this, { tab, box, spec });
    this.row = readRows(spec.rows);
    [this.azimuth, this.elevation] = [spec.rows.azimuth, spec.rows.elevation].map(array);
    box.addEventListener("pointermove", (event) => this.hover(event));
    box.addEventListener("pointerleave", hideTip);
  }

  refresh() {}

  draw(width) {
    this.width = width;
    const height = (this.height = Math.round(Math.min(width, 300)));
    this.radius = height / 2 - 20;
    const [cx, cy] = [width / 2, height / 2];
    this.svg = element("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${this.spec.title}: the sky of the station, with what was measured` });
    const grid = element("g", { class: "grid-lines" });
    for (const elevation of [0, 30, 60]) grid.append(element("circle", { cx, cy, r: this.radius * (1 - elevation / 90), class: "ring" }));
    for (const elevation of [30, 60]) grid.append(element("text", { x: cx + 3, y: cy - this.radius * (1 - elevation / 90) - 3 }, `${elevation}°`));
    ["N", "E", "S", "W"].forEach((name, i) => {
      const [x, y] = [cx + (this.radius + 10) * Math.sin((i * Math.PI) / 2), cy - (this.radius + 10) * Math.cos((i * Math.PI) / 2)];
      grid.append(element("text", { x, y: y + 4, "text-anchor": "middle", class: "label" }, name));
    });
    let [line, dots, crosses, pen] = ["", "", "", "M"];
    this.points = Array.from(this.azimuth, (_, i) => {
      const p = this.px(i);
      if (!p) {
        pen = "M";
        return null;
      }
      line += `${pen}${p[0].toFixed(1)} ${p[1].toFixed(1)}`;
      pen = "L";
      if (this.row.used[i]) dots += `M${p[0].toFixed(1)} ${p[1].toFixed(1)}h0`;
      else crosses += cross(...p);
      return p;
    });
    const { colour } = this.row;
    this.mark = element("circle", { r: 6, class: "object", visibility: "hidden" });
    this.svg.append(grid, element("path", { d: line, stroke: colour, class: "whole", fill: "none" }), element("path", { d: dots, stroke: colour, class: "dots pass" }));
    this.svg.append(element("path", { d: crosses, class: "rejected" }), this.mark);
    this.box.replaceChildren(this.svg);
    this.move();
  }

  px(i) {
    const [a, e] = [this.azimuth[i], this.elevation[i]];
    if (Number.isNaN(a)) return null;
    const r = this.radius * (1 - Math.max(e, 0) / (Math.PI / 2));
    return [this.width / 2 + r * Math.sin(a), this.height / 2 - r * Math.cos(a)];
  }

  // The measurement at the cursor, while one is near.
  move() {
    if (!this.svg) return;
    let best = -1;
    this.row.seconds.forEach((t, i) => {
      if (this.points[i] && (best < 0 || Math.abs(t - this.tab.time) < Math.abs(this.row.seconds[best] - this.tab.time))) best = i;
    });
    const near = best >= 0 && Math.abs(this.row.seconds[best] - this.tab.time) < 300;
    this.mark.setAttribute("visibility", near ? "visible" : "hidden");
    if (!near) return;
    this.mark.setAttribute("cx", this.points[best][0]);
    this.mark.setAttribute("cy", this.points[best][1]);
  }

  hover(event) {
    if (!this.svg) return;
    const [x, y] = under(event, this.svg, this.width);
    let [best, least] = [-1, 12];
    this.points.forEach((p, i) => {
      const d = p ? Math.hypot(p[0] - x, p[1] - y) : Infinity;
      if (d < least) [best, least] = [i, d];
    });
    if (best < 0) return hideTip();
    const turned = (v) => `${number((v * 180) / Math.PI, 4)}°`;
    const when = this.tab.when(this.row.seconds[best]);
    const place = { colour: this.row.colour, name: "azimuth, elevation", value: `${turned(this.azimuth[best])}, ${turned(this.elevation[best])}` };
    showTip(event, when, [place, ...this.row.tip(best)]);
  }

  table() {
    const rows = [["series", ...this.tab.timeHeads, "azimuth [deg]", "elevation [deg]", "used", "note"]];
    this.points.forEach((p, i) => p && rows.push([this.row.label, ...this.tab.timeCells(this.row.seconds[i]), ...[this.azimuth[i], this.elevation[i]].map((v) => (v * 180) / Math.PI), this.row.used[i], this.row.note(i)]));
    return rows;
  }
}
