// The ground track on a map with equal steps of longitude and latitude.

class WorldMap extends World {
  draw(width) {
    this.width = width;
    this.left = 30;
    this.scale = (width - this.left - 6) / 360;
    this.height = Math.round(180 * this.scale + 30);
    const id = `clip-${this.tab.id}-${this.box.dataset.drawing}`;
    const frame = { x: this.left, y: 6, width: 360 * this.scale, height: 180 * this.scale };
    this.svg = element("svg", {
      viewBox: `0 0 ${width} ${this.height}`, role: "img",
      "aria-label": `${this.spec.title}: where the object was overhead, stations, and where it was when it was measured`,
    });
    this.svg.append(element("defs", {}, element("clipPath", { id }, element("rect", frame))));
    const still = element("g", { "clip-path": `url(#${id})` });
    still.append(element("rect", { ...frame, class: "ocean" }), element("path", { d: this.ground(), class: "land", "fill-rule": "evenodd" }));
    this.shade = element("path", { class: "night" });
    const marks = element("g", { class: "grid-lines" });
    for (let l = -180; l <= 180; l += 60) {
      const x = this.px([l, 0])[0];
      still.append(element("line", { x1: x, x2: x, y1: 6, y2: 6 + frame.height, class: "graticule" }));
      if (Math.abs(l) < 180 || width > 420) {
        const anchor = l === 180 ? "end" : l === -180 ? "start" : "middle";
        marks.append(element("text", { x: l === -180 ? x - 8 : x, y: this.height - 6, "text-anchor": anchor }, `${l}°`.replace("-", "−")));
      }
    }
    for (let p = -60; p <= 60; p += 30) {
      const y = this.px([0, p])[1];
      still.append(element("line", { x1: this.left, x2: width - 6, y1: y, y2: y, class: "graticule" }));
      if (p % 60 === 0) marks.append(element("text", { x: this.left - 5, y: y + 4, "text-anchor": "end" }, `${p}°`.replace("-", "−")));
    }
    still.append(this.shade, element("path", { d: this.track(0, this.place.length - 1), class: "far way" }));
    this.moving = element("g", { "clip-path": `url(#${id})` });
    const sites = this.rows.filter((row) => row.site).map((row) => [row, ...this.onPaper(row.site)]);
    this.svg.append(still, marks, this.moving);
    const fixed = element("g", { "clip-path": `url(#${id})` });
    for (const row of this.rows) this.measured(row, fixed);
    for (const [row, x, y] of sites) fixed.append(element("circle", { cx: x, cy: y, r: 4.5, fill: row.colour, class: "site" }));
    this.dot = element("circle", { r: 5.5, class: "object" });
    this.svg.append(fixed, this.names(sites), this.dot);
    this.box.replaceChildren(this.svg);
    this.move();
  }

  px([longitude, latitude]) {
    return [this.left + (longitude + 180) * this.scale, 6 + (90 - latitude) * this.scale];
  }

  onPaper(place) {
    return this.px(lonLat(place));
  }

  // Rings without jumps, three times side by side; one about the pole is closed below the map.
  ground() {
    let d = "";
    for (const ring of this.land) {
      let longitude = ring[0][0];
      const points = ring.map(([l, p]) => {
        longitude += l - longitude - 360 * Math.round((l - longitude) / 360);
        return [longitude, p];
      });
      if (Math.abs(points[points.length - 1][0] - points[0][0]) > 180) points.push([points[points.length - 1][0], -90], [points[0][0], -90]);
      for (const by of [-360, 0, 360]) d += `M${points.map(([l, p]) => this.px([l + by, p]).map((v) => v.toFixed(1)).join(" ")).join("L")}Z`;
    }
    return d;
  }

  track(from, to) {
    let d = "";
    let before = null;
    for (let i = from; i <= to; i++) {
      let [l, p] = lonLat(this.place[i]);
      if (before !== null && Math.abs(l - before[0]) > 180) {
        const by = l < before[0] ? 360 : -360;
        d += `L${this.text([l + by, p])}M${this.text([before[0] - by, before[1]])}`;
      }
      d += `${before === null ? "M" : "L"}${this.text([l, p])}`;
      before = [l, p];
    }
    return d;
  }

  text(point) {
    return this.px(point).map((v) => v.toFixed(1)).join(" ");
  }

  measured(row, fixed) {
    let [dots, crosses] = ["", ""];
    row.place.forEach((p, i) => {
      if (Number.isNaN(p[0])) return;
      const [x, y] = this.onPaper(p);
      if (row.used[i]) dots += `M${x.toFixed(1)} ${y.toFixed(1)}h0`;
      else crosses += cross(x, y);
    });
    fixed.append(element("path", { d: dots, stroke: row.colour, class: row.site ? "dots pass" : "dots pass fixes" }), element("path", { d: crosses, class: "rejected" }));
  }

  move() {
    if (!this.svg) return;
    const k = this.index;
    const [from, to] = this.lately();
    this.moving.replaceChildren(element("path", { d: this.track(from, to), class: "near way" }));
    const [x, y] = this.onPaper(this.place[k]);
    this.dot.setAttribute("cx", x);
    this.dot.setAttribute("cy", y);
    this.shade.setAttribute("d", this.night(this.sun[k]));
  }

  // Where the Sun is below the horizon: on this side of the circle that is a right angle from it.
  night(sun) {
    const [l, p] = lonLat(sun);
    const pole = p > 0 ? -90 : 90;
    const t = Math.tan((Math.abs(p) < 0.2 ? 0.2 * (p < 0 ? -1 : 1) : p) * (Math.PI / 180));
    const edge = Array.from({ length: 121 }, (_, i) => {
      const longitude = -180 + 3 * i;
      return this.text([longitude, (Math.atan(-Math.cos(((longitude - l) * Math.PI) / 180) / t) * 180) / Math.PI]);
    });
    return `M${edge.join("L")}L${this.text([180, pole])}L${this.text([-180, pole])}Z`;
  }
}
