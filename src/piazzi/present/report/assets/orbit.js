// The path about the planet, or the errors about the truth: dots and 3-sigma ellipses at the cursor.

class Orbit {
  constructor(tab, box, spec) {
    Object.assign(this, { tab, box, spec });
    const f = spec.show[1];
    const read = (index, by = f) => (index === null ? null : array(index).map((v) => v * by));
    this.tracks = spec.tracks.map((t) => ({
      ...t,
      x: read(t.x),
      y: read(t.y),
      sx: read(t.sx),
      sy: read(t.sy),
      rho: read(t.rho, 1),
      colour: t.key >= 0 ? tab.keys[t.key].colour : "var(--ink)",
      dash: t.key >= 0 ? tab.keys[t.key].dash.join(" ") : "",
    }));
    this.side = spec.mirrored ? -1 : 1; // as a sky is seen from within, with east to the left
    const steps = Array.from(tab.times.slice(1), (t, i) => t - tab.times[i]);
    const usual = [...steps].sort((p, q) => p - q)[steps.length >> 1];
    this.breaks = new Set(steps.flatMap((step, i) => (step > 5 * usual ? [i + 1] : []))); // between passes a chord would be no path
    box.addEventListener("pointermove", (event) => this.hover(event));
    box.addEventListener("pointerleave", hideTip);
  }

  shown(track) {
    return track.key < 0 || this.tab.visible.has(track.key);
  }

  draw(width) {
    this.width = width;
    const [a, b, c, d] = this.spec.limits.map((v) => v * this.spec.show[1]);
    const room = [width - 76, Math.min(430, Math.max(260, width * 0.75)) - 64];
    this.unit = this.spec.close ? null : Math.min(room[0] / (b - a), room[1] / (d - c));
    const height = (this.height = Math.round(room[1] + 64));
    this.frame = { left: 64, right: width - 12, top: 26, bottom: height - 38 };
    this.middle = [(this.frame.left + this.frame.right) / 2, (this.frame.top + this.frame.bottom) / 2];
    this.centre = this.spec.close ? [0, 0] : [(a + b) / 2, (c + d) / 2];
    const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": this.described() });
    const id = `clip-${this.tab.id}-${this.box.dataset.drawing}`;
    const { left, right, top, bottom } = this.frame;
    svg.append(element("defs", {}, element("clipPath", { id }, element("rect", { x: left, y: top, width: right - left, height: bottom - top }))));
    this.grid = element("g", { class: "grid-lines" });
    this.still = element("g", { "clip-path": `url(#${id})` });
    this.moving = element("g", { "clip-path": `url(#${id})` });
    this.empty = element("text", { x: this.middle[0], y: this.middle[1], "text-anchor": "middle", class: "empty" });
    this.sites = element("g", { "clip-path": `url(#${id})` });
    svg.append(this.grid, this.still, this.moving, this.sites, this.empty);
    this.box.replaceChildren(svg);
    this.svg = svg;
    this.tracks.forEach((track) => this.prepare(track));
    if (!this.spec.close) this.background();
    this.refresh();
  }

  px(x) {
    return this.middle[0] + this.side * (x - this.centre[0]) * this.unit;
  }

  py(y) {
    return this.middle[1] - (y - this.centre[1]) * this.unit;
  }

  prepare(track) {
    const style = { stroke: track.colour, fill: "none", "stroke-dasharray": track.dash };
    track.ellipse = element("ellipse", { ...style, fill: track.colour, class: "ellipse" });
    track.dot = element("circle", { r: track.key < 0 ? 5 : 4, fill: track.colour, class: track.key < 0 ? "true dot" : "dot" });
    if (!this.spec.close) {
      track.whole = element("path", { ...style, class: track.key < 0 ? "true whole" : "whole" });
      track.trail = element("path", { ...style, class: track.key < 0 ? "true trail" : "trail" });
      this.still.append(track.whole);
      this.moving.append(track.trail);
    }
    const named = track.key < 0 && track.label !== "truth"; // a body beside the object
    track.name = element("text", { class: "reference" }, named ? track.label : "");
    this.moving.append(track.ellipse, track.dot, track.name);
  }

  background() {
    const f = this.spec.show[1];
    if (this.spec.planet) {
      this.still.prepend(element("circle", { cx: this.px(0), cy: this.py(0), r: this.spec.planet * f * this.unit, class: "planet" }));
      const wide = this.spec.planet * f * this.unit > 44;
      if (wide) this.still.append(element("text", { x: this.px(0), y: this.py(0) + 4, "text-anchor": "middle", class: "on-planet" }, "central body"));
    }
    for (const ring of this.spec.rings) {
      const [xs, ys] = ring.map(array);
      const points = Array.from(xs, (x, i) => `${this.px(x * f).toFixed(1)} ${this.py(ys[i] * f).toFixed(1)}`);
      this.still.append(element("path", { d: `M${points.join("L")}`, class: "ring" }));
    }
    for (const track of this.tracks) {
      track.points = Array.from(track.x, (x, i) => {
        const far = (v) => Math.min(Math.max(v, -2000), 4000).toFixed(1);
        return Number.isNaN(x) || Number.isNaN(track.y[i]) ? "" : `${far(this.px(x))} ${far(this.py(track.y[i]))}`;
      });
      track.whole.setAttribute("d", joined(track.points, this.breaks));
    }
    for (const site of this.spec.sites) this.sites.append(this.site(site));
    this.axes();
  }

  // A station that stands still is a triangle with its name, one that turns with the Earth dots where it measured.
  site({ label, colour, x, y }) {
    const f = this.spec.show[1];
    const [xs, ys] = [array(x), array(y)].map((values, i) => Array.from(values, (v) => (i ? this.py(v * f) : this.px(v * f))));
    const title = element("title", {}, `station ${label}`);
    if (xs.length > 1) return element("path", { d: Array.from(xs, (at, i) => `M${at.toFixed(1)} ${ys[i].toFixed(1)}h0`).join(""), stroke: colour, class: "dots" }, title);
    const mark = element("path", { d: `M${xs[0]} ${ys[0] - 6}l6 10h-12z`, fill: colour, class: "site" }, title);
    return element("g", {}, mark, element("text", { x: xs[0] + 9, y: ys[0] + 4, class: "reference" }, label));
  }

  axes() {
    const { left, right, top, bottom } = this.frame;
    const linear = { scale: "linear" };
    const half = (right - left) / 2 / this.unit;
    const x = scaleOf(linear, this.centre[0] - half, this.centre[0] + half, ...(this.side > 0 ? [left, right] : [right, left]));
    const y = scaleOf(linear, this.centre[1] - (bottom - this.middle[1]) / this.unit, this.centre[1] + (this.middle[1] - top) / this.unit, bottom, top);
    const grid = [];
    for (const v of ticks(x, 90)) {
      const at = x.place(v);
      grid.push(element("line", { x1: at, x2: at, y1: top, y2: bottom }));
      grid.push(element("text", { x: inward(at, tickText(v), this.width), y: bottom + 17, "text-anchor": "middle" }, tickText(v)));
    }
    for (const v of ticks(y, 60)) {
      const at = y.place(v);
      grid.push(element("line", { x1: left, x2: right, y1: at, y2: at }));
      grid.push(element("text", { x: left - 6, y: at + 4, "text-anchor": "end" }, tickText(v)));
    }
    const [across, up] = this.spec.labels.map((label) => labelled({ label, show: this.spec.show }));
    grid.push(element("text", { x: 2, y: 13, class: "label" }, up));
    grid.push(element("text", { x: right, y: this.height - 4, "text-anchor": "end", class: "label" }, across));
    this.grid.replaceChildren(...grid);
  }

  refresh() {
    if (!this.svg) return;
    for (const track of this.tracks) {
      const display = this.shown(track) ? "" : "none";
      track.ellipse.classList.toggle("close", track.key === this.tab.focus);
      for (const mark of [track.whole, track.trail, track.ellipse, track.dot]) if (mark) mark.style.display = display;
    }
    const any = this.tracks.some((t) => t.key >= 0 && this.shown(t));
    this.empty.textContent = any ? "" : "switched off in the legend";
    this.move();
  }

  move() {
    if (!this.svg) return;
    const k = this.tab.index;
    if (this.spec.close) this.rescale(k);
    for (const track of this.tracks) this.place(track, k);
  }

  place(track, k) {
    if (!this.shown(track)) return;
    const [x, y] = [track.x[k], track.y[k]];
    const there = Number.isFinite(x) && Number.isFinite(y);
    track.dot.setAttribute("visibility", there ? "visible" : "hidden");
    if (track.trail) track.trail.setAttribute("d", joined(track.points.slice(0, k + 1), this.breaks));
    const oval = there && track.sx ? ellipseOf(track.sx[k], track.sy[k], track.rho[k]) : null;
    track.ellipse.setAttribute("visibility", oval ? "visible" : "hidden");
    if (!there) return;
    const [cx, cy] = [this.px(x), this.py(y)];
    track.dot.setAttribute("cx", cx);
    track.dot.setAttribute("cy", cy);
    track.name.setAttribute("x", cx + 7);
    track.name.setAttribute("y", cy - 5);
    if (!oval) return;
    for (const [name, value] of [["cx", cx], ["cy", cy], ["rx", oval.a * this.unit], ["ry", oval.b * this.unit]]) track.ellipse.setAttribute(name, value);
    track.ellipse.setAttribute("transform", `rotate(${(-this.side * oval.angle * 180) / Math.PI} ${cx} ${cy})`);
  }

  // Half-width in round numbers that holds every dot and ellipse shown, so that the axes jump rarely.
  rescale(k) {
    let reach = 0;
    for (const t of this.tracks)
      if (this.shown(t)) {
        const sizes = [Math.abs(t.x[k]) + 3 * (t.sx ? t.sx[k] : 0), Math.abs(t.y[k]) + 3 * (t.sy ? t.sy[k] : 0)];
        for (const size of sizes) if (Number.isFinite(size) && size > reach) reach = size;
      }
    const half = roundStep(1.05 * (reach || 1));
    const { left, right, top, bottom } = this.frame;
    const unit = Math.min(right - left, bottom - top) / 2 / half;
    if (unit === this.unit) return;
    this.unit = unit;
    this.axes();
  }

  table() {
    const [x, y] = this.spec.labels.map((label) => labelled({ label, show: this.spec.show }));
    const rows = [["series", ...this.tab.timeHeads, x, y]];
    for (const t of this.tracks) t.x.forEach((v, i) => rows.push([t.label, ...this.tab.timeCells(this.tab.times[i]), v, t.y[i]]));
    return rows;
  }

  described() {
    return `${this.spec.title}: ${this.spec.labels.join(" and ")}; ${this.tracks.map((t) => t.label).join(", ")}`;
  }

  hover(event) {
    if (!this.svg) return;
    const k = this.tab.index;
    const unit = this.spec.show[0];
    const rows = this.tracks
      .filter((t) => this.shown(t))
      .map((t) => ({ colour: t.colour, name: t.label, value: withUnit(`${number(t.x[k])}, ${number(t.y[k])}`, unit) }));
    showTip(event, `${this.tab.clock()}: ${this.spec.labels.join(", ")}`, rows);
  }
}

// Half axes and angle of the 3-sigma ellipse of a covariance.
function ellipseOf(sx, sy, rho) {
  const [a, b, c] = [sx * sx, sy * sy, rho * sx * sy];
  const root = Math.hypot((a - b) / 2, c);
  const [large, small] = [(a + b) / 2 + root, Math.max((a + b) / 2 - root, 0)];
  if (!Number.isFinite(large)) return null;
  return { a: 3 * Math.sqrt(large), b: 3 * Math.sqrt(small), angle: 0.5 * Math.atan2(2 * c, a - b) };
}

function joined(points, breaks) {
  let out = "";
  let pen = "M";
  points.forEach((point, i) => {
    if (point === "" || breaks.has(i)) pen = "M";
    if (point === "") return;
    out += pen + point;
    pen = "L";
  });
  return out;
}
