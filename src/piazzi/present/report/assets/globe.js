// An orthographic globe: dragged or turned by keys; what is drawn moves with the stars or with the Earth.

class Globe extends World {
  constructor(tab, box, spec) {
    super(tab, box, spec);
    this.rings = this.land.map((ring) => ring.map(unitOf));
    this.grid = [];
    for (let l = -180; l < 180; l += 30) this.grid.push(Array.from({ length: 31 }, (_, i) => unitOf([l, -75 + 5 * i])));
    for (let p = -60; p <= 60; p += 30) this.grid.push(Array.from({ length: 73 }, (_, i) => unitOf([-180 + 5 * i, p])));
    this.still = true; // among the stars
    this.reset();
    this.controls();
    box.addEventListener("pointerdown", (event) => this.take(event));
    box.addEventListener("pointermove", (event) => this.drag(event));
    for (const end of ["pointerup", "pointercancel"]) box.addEventListener(end, () => (this.grip = null));
  }

  reset() {
    [this.lon, this.lat] = this.spec.start;
    this.zoom = 1;
  }

  controls() {
    const bar = element("div", { class: "tools", role: "group", "aria-label": "Globe" });
    const button = (label, name, act) => {
      const out = element("button", { type: "button", class: "quiet", "aria-label": name, title: name }, label);
      out.addEventListener("click", () => {
        act(out);
        this.paint();
      });
      bar.append(out);
      return out;
    };
    button("+", "Nearer", () => this.nearer(1.25));
    button("−", "Farther", () => this.nearer(0.8));
    button("Reset", "As at first", () => this.reset());
    const held = button("Turn with the Earth", "Turn with the Earth", (self) => {
      this.still = !this.still;
      this.lon += (this.still ? 1 : -1) * this.turned[this.index];
      self.setAttribute("aria-pressed", !this.still);
    });
    held.setAttribute("aria-pressed", "false");
    this.box.after(bar);
  }

  nearer(by) {
    this.zoom = Math.min(12, Math.max(0.5, this.zoom * by));
  }

  draw(width) {
    this.width = width;
    this.height = Math.round(Math.min(460, Math.max(260, width * 0.8)));
    this.svg = element("svg", {
      viewBox: `0 0 ${width} ${this.height}`, role: "img", tabindex: 0, class: "globe",
      "aria-label": `${this.spec.title}: the Earth with the orbit, stations and passes; arrow keys turn it, plus and minus change the size`,
    });
    this.svg.addEventListener("keydown", (event) => this.key(event));
    this.box.replaceChildren(this.svg);
    this.paint();
  }

  key(event) {
    const step = 0.09;
    const act = {
      ArrowLeft: () => (this.lon -= step), ArrowRight: () => (this.lon += step),
      ArrowUp: () => (this.lat = Math.min(1.5, this.lat + step)), ArrowDown: () => (this.lat = Math.max(-1.5, this.lat - step)),
      "+": () => this.nearer(1.25), "=": () => this.nearer(1.25), "-": () => this.nearer(0.8), Home: () => this.reset(),
    }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
    this.paint();
  }

  take(event) {
    if (event.button === 0 && this.svg.contains(event.target)) {
      this.grip = { x: event.clientX, y: event.clientY, lon: this.lon, lat: this.lat };
      this.box.setPointerCapture?.(event.pointerId);
      hideTip();
    }
  }

  drag(event) {
    if (!this.grip) return;
    const per = 1 / Math.max(this.scale() * RADIUS, 60);
    this.lon = this.grip.lon - (event.clientX - this.grip.x) * per;
    this.lat = Math.min(1.5, Math.max(-1.5, this.grip.lat + (event.clientY - this.grip.y) * per));
    this.paint();
  }

  scale() {
    return (this.zoom * (Math.min(this.width, this.height) / 2 - 10)) / this.reach;
  }

  move() {
    if (this.svg && this.box.clientWidth) this.paint();
  }

  // Right, up and towards the reader, of a vector fixed to the Earth when that is turned so far (null: as at the cursor).
  seen(v, turned) {
    const angle = this.lon - (this.still ? (turned === null ? this.turned[this.now] : turned) : 0);
    const [c, s, cp, sp] = [Math.cos(angle), Math.sin(angle), Math.cos(this.lat), Math.sin(this.lat)];
    const ahead = c * v[0] + s * v[1];
    return [-s * v[0] + c * v[1], cp * v[2] - sp * ahead, sp * v[2] + cp * ahead];
  }

  px([x, y]) {
    return [this.width / 2 + x * this.unit, this.height / 2 - y * this.unit];
  }

  onPaper(v, turned) {
    const at = this.seen(v, turned);
    const hidden = turned === null ? at[2] < 0 : at[2] < 0 && Math.hypot(at[0], at[1]) < RADIUS;
    return hidden ? null : this.px(at);
  }

  paint() {
    if (!this.svg) return;
    this.now = this.index;
    this.unit = this.scale();
    const [cx, cy, r] = [this.width / 2, this.height / 2, RADIUS * this.unit];
    const [first, last] = this.lately();
    const behind = element("g");
    const before = element("g");
    const path = this.path(this.still ? 0 : first, this.still ? this.place.length - 1 : last);
    behind.append(element("path", { d: path[0], class: "far way" }));
    before.append(element("path", { d: this.tube(first, last), class: "tube" }), element("path", { d: path[1], class: "near way" }));
    for (const row of this.rows) this.measured(row, behind, before);
    const ball = element("g");
    ball.append(element("circle", { cx, cy, r, class: "ocean" }));
    ball.append(element("path", { d: this.surface(this.rings), class: "land", "fill-rule": "evenodd" }));
    ball.append(element("path", { d: this.lines(), class: "graticule" }));
    ball.append(element("path", { d: this.surface([this.night()]), class: "night", "fill-rule": "evenodd" }));
    ball.append(element("circle", { cx, cy, r, class: "limb" }));
    const sites = this.rows.filter((row) => row.site).map((row) => [row, this.onPaper(row.site, null)]);
    const there = sites.filter(([, at]) => at).map(([row, at]) => [row, ...at]);
    for (const [row, x, y] of there) before.append(element("circle", { cx: x, cy: y, r: 4.5, fill: row.colour, class: "site" }));
    const where = this.seen(this.place[this.now], this.turned[this.now]);
    const [x, y] = this.px(where);
    const dot = element("circle", { cx: x, cy: y, r: 5.5, class: "object" });
    (where[2] < 0 ? behind : before).append(dot);
    this.svg.replaceChildren(behind, ball, before, this.names(there));
  }

  // The way from one sample to another: what is behind the centre of the Earth, and what is before it.
  path(from, to) {
    const out = ["", ""];
    let side = -1;
    for (let i = from; i <= to; i++) {
      const at = this.seen(this.place[i], this.turned[i]);
      const [x, y] = this.px(at);
      const now = at[2] < 0 ? 0 : 1;
      const point = `${x.toFixed(1)} ${y.toFixed(1)}`;
      if (side >= 0) out[side] += `L${point}`;
      if (now !== side) out[now] += `M${point}`;
      side = now;
    }
    return out;
  }

  // Three sigma across the way as it is seen, so many times as wide as it is.
  tube(from, to) {
    let d = "";
    let before = null;
    for (let i = from; i <= to; i++) {
      const P = this.covariance[i];
      if (Number.isNaN(P[0])) {
        before = null;
        continue;
      }
      const [a, b] = [Math.max(i - 1, 0), Math.min(i + 1, this.place.length - 1)].map((k) => this.seen(this.place[k], this.turned[k]));
      const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
      const length = Math.hypot(dx, dy) || 1;
      const n = [-dy / length, dx / length];
      const wide = Math.min(3 * this.spec.factor * this.spread(P, n, this.turned[i]), this.reach);
      const at = this.seen(this.place[i], this.turned[i]);
      const edges = [1, -1].map((s) => this.px([at[0] + s * wide * n[0], at[1] + s * wide * n[1]]).map((v) => v.toFixed(1)).join(" "));
      if (before) d += `M${before[0]}L${edges[0]}L${edges[1]}L${before[1]}Z`;
      before = edges;
    }
    return d;
  }

  // Sigma along a direction on paper: the root of e P e, where e is that direction on the axes of the covariance.
  spread(P, n, turned) {
    const angle = this.lon - (this.still ? turned : 0);
    const [c, s, cp, sp] = [Math.cos(angle), Math.sin(angle), Math.cos(this.lat), Math.sin(this.lat)];
    const e = [-s * n[0] - sp * c * n[1], c * n[0] - sp * s * n[1], cp * n[1]];
    const [xx, xy, xz, yy, yz, zz] = P;
    const square = e[0] * (xx * e[0] + 2 * xy * e[1] + 2 * xz * e[2]) + e[1] * (yy * e[1] + 2 * yz * e[2]) + zz * e[2] * e[2];
    return Math.sqrt(Math.max(square, 0));
  }

  measured(row, behind, before) {
    const d = ["", ""];
    let crosses = "";
    row.place.forEach((p, i) => {
      if (Number.isNaN(p[0])) return;
      const at = this.seen(p, row.turned[i]);
      const [x, y] = this.px(at);
      if (row.used[i]) d[at[2] < 0 ? 0 : 1] += `M${x.toFixed(1)} ${y.toFixed(1)}h0`;
      else if (at[2] >= 0) crosses += cross(x, y);
    });
    behind.append(element("path", { d: d[0], stroke: row.colour, class: row.site ? "dots pass" : "dots pass fixes" }));
    before.append(element("path", { d: d[1], stroke: row.colour, class: row.site ? "dots pass" : "dots pass fixes" }), element("path", { d: crosses, class: "rejected" }));
  }

  // Rings on the sphere: what is behind is moved to the limb, and a ring about the point that is farthest takes in the whole disc.
  surface(rings) {
    const r = RADIUS * this.unit;
    const [cx, cy] = [this.width / 2, this.height / 2];
    let d = "";
    for (const ring of rings) {
      let part = "";
      let [winding, before, hidden, visible] = [0, null, false, false];
      for (const v of ring) {
        const [x, y, z] = this.seen(v, null);
        const length = Math.hypot(x, y);
        const out = z < 0 && length > 0 ? 1 / length : 1;
        visible ||= z > 0;
        const angle = Math.atan2(y, x);
        const turned = before === null ? 0 : turn(angle - before);
        // along the limb, where two points behind are far apart on it
        const steps = z < 0 && hidden ? Math.ceil(Math.abs(turned) / 0.05) : 1;
        for (let i = 1; i < steps; i++) {
          const between = before + (i * turned) / steps;
          part += `L${(cx + Math.cos(between) * r).toFixed(1)} ${(cy - Math.sin(between) * r).toFixed(1)}`;
        }
        part += `${part ? "L" : "M"}${(cx + x * out * r).toFixed(1)} ${(cy - y * out * r).toFixed(1)}`;
        winding += turned;
        [before, hidden] = [angle, z < 0];
      }
      const [x, y] = this.seen(ring[0], null);
      winding += turn(Math.atan2(y, x) - before);
      const about = winding < -Math.PI;
      if (visible || about) d += `${part}Z`;
      if (about) d += `M${cx - r} ${cy}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`;
    }
    return d;
  }

  lines() {
    let d = "";
    for (const line of this.grid) {
      let pen = "M";
      for (const v of line) {
        const at = this.seen(v, null);
        if (at[2] < 0) pen = "M";
        else {
          const [x, y] = this.px([at[0] * RADIUS, at[1] * RADIUS]);
          d += `${pen}${x.toFixed(1)} ${y.toFixed(1)}`;
          pen = "L";
        }
      }
    }
    return d;
  }

  // The great circle between day and night, with the night on its left.
  night() {
    const s = this.sun[this.now];
    const other = Math.abs(s[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    const a = unit(product(s, other));
    const b = product(s, a);
    return Array.from({ length: 120 }, (_, i) => {
      const t = (-2 * Math.PI * i) / 120;
      return a.map((v, j) => v * Math.cos(t) + b[j] * Math.sin(t));
    });
  }
}

function turn(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

function product(a, b) {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function unit(v) {
  const length = Math.hypot(...v);
  return v.map((x) => x / length);
}
