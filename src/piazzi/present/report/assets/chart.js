// One pair of axes, drawn anew when its width changes; the cursor and what is hidden change without drawing.

class Chart {
  constructor(tab, box, spec) {
    Object.assign(this, { tab, box, spec });
    const [fx, fy] = [spec.x.show[1], spec.y.show[1]];
    this.lines = spec.lines.map((line) => ({
      ...line,
      seconds: array(line.x),
      x: array(line.x).map((v) => v * fx),
      y: array(line.y).map((v) => v * fy * line.times),
      colour: line.key >= 0 ? tab.keys[line.key].colour : line.colour,
      dash: line.key >= 0 ? tab.keys[line.key].dash : line.dash,
      name: line.key >= 0 ? tab.keys[line.key].label : line.label,
    }));
    for (const line of this.lines) {
      const about = line.about === null ? null : array(line.about);
      line.upper = about && line.kind !== "spread" ? line.y.map((v, i) => about[i] * fy + v) : line.y;
      if (line.kind === "spread") [line.upper, line.lower] = [line.y, Array.from(about, (v) => v * fy)];
      if (line.kind === "band") line.lower = about ? line.y.map((v, i) => about[i] * fy - v) : line.y.map((v) => -v);
    }
    this.xAxis = scaled(spec.x, fx);
    this.yAxis = scaled(spec.y, fy);
    this.listen();
  }

  shown(line) {
    if (line.key < 0) return true;
    return this.tab.visible.has(line.key) && (!this.spec.single || line.key === this.tab.focus);
  }

  limits() {
    const zoom = this.spec.time ? this.tab.zoom : null;
    const x = this.spec.time ? this.tab.span : extent(this.lines.map((l) => l.x), this.xAxis);
    const y = extent(this.lines.flatMap((l) => (l.kind === "spread" ? [l.y, l.lower] : [l.y])), this.yAxis);
    const fx = this.spec.x.show[1];
    const whole = [this.yAxis.low ?? y[0], this.yAxis.high ?? y[1]];
    return {
      x: zoom ? zoom.map((t) => t * fx) : this.spec.time ? x.map((t) => t * fx) : [this.xAxis.low ?? x[0], this.xAxis.high ?? x[1]],
      y: zoom ? this.closer(zoom, whole) : whole,
    };
  }

  // Limits of y for a stretch of time: its values and what they are compared with, no farther than those of the whole run.
  closer([from, to], whole) {
    const f = this.spec.y.show[1];
    const within = ({ seconds }, values) => values.filter((_, i) => seconds[i] >= from && seconds[i] <= to);
    const values = this.lines.map((line) => within(line, line.upper));
    if (!values.some((v) => v.some(Number.isFinite))) return whole;
    const below = this.lines.filter((line) => line.kind === "band").map((line) => within(line, line.lower));
    const beside = [...this.spec.ranges.flatMap(([low, high]) => [low, high]), ...this.spec.levels.map(([level]) => level)];
    let [low, high] = extent([...values, ...below, beside.map((v) => v * f)], this.yAxis);
    if (this.yAxis.scale === "symmetric") {
      high = Math.max(Math.abs(low), Math.abs(high), 10 * this.yAxis.threshold);
      low = -high;
    }
    const cut = [Math.max(low, whole[0]), Math.min(high, whole[1])];
    return cut[0] < cut[1] ? cut : whole;
  }

  draw(width) {
    this.width = width;
    const height = (this.height = Math.round(Math.min(300, Math.max(210, width * 0.46))));
    const { x, y } = this.limits();
    const foot = this.calendar ? 51 : 38; // the day stands below the hour
    this.sy = scaleOf(this.yAxis, ...y, height - foot, 26);
    const marks = ticks(this.sy, 34);
    const texts = marks.map((v) => tickText(v));
    const left = 14 + 7 * Math.max(3, ...texts.map((t) => t.length));
    this.sx = scaleOf(this.xAxis, ...x, left, width - 12);
    const id = `clip-${this.tab.id}-${this.box.dataset.drawing}`;
    const [top, bottom, right] = [26, height - foot, width - 12];
    const svg = element("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": this.described() });
    svg.append(element("defs", {}, element("clipPath", { id }, element("rect", { x: left, y: top - 1, width: right - left, height: bottom - top + 2 }))));
    const grid = element("g", { class: "grid-lines" });
    marks.forEach((v, i) => {
      const at = this.sy.place(v);
      grid.append(element("line", { x1: left, x2: right, y1: at, y2: at, class: v === 0 ? "zero" : "" }));
      grid.append(element("text", { x: left - 6, y: at + 4, "text-anchor": "end" }, texts[i]));
    });
    let free = -Infinity;
    for (const [v, text, below] of this.marked()) {
      const at = this.sx.place(v);
      grid.append(element("line", { x1: at, x2: at, y1: bottom, y2: bottom + 4, class: "tick" }));
      const middle = inward(at, text, width);
      if (middle - 3.6 * text.length < free) continue;
      free = middle + 3.6 * text.length + 4;
      grid.append(element("text", { x: middle, y: bottom + 17, "text-anchor": "middle" }, text));
      if (below) grid.append(element("text", { x: inward(at, below, width), y: bottom + 30, "text-anchor": "middle" }, below));
    }
    grid.append(element("line", { x1: left, x2: right, y1: bottom, y2: bottom, class: "axis" }));
    svg.append(grid);
    svg.append(element("text", { x: 2, y: 13, class: "label" }, labelled(this.spec.y)));
    svg.append(element("text", { x: right, y: height - 4, "text-anchor": "end", class: "label" }, this.xLabel()));
    this.inside = element("g", { "clip-path": `url(#${id})` });
    svg.append(this.inside);
    this.stretches(top, bottom);
    this.references(left, right);
    this.drawLines();
    this.hair = element("line", { y1: top, y2: bottom, class: "hair", visibility: "hidden" });
    this.cursor = element("line", { y1: top, y2: bottom, class: "cursor" });
    this.brush = element("rect", { y: top, height: bottom - top, width: 0, class: "brush" });
    this.inside.append(this.brush, this.hair);
    this.empty = element("text", { x: (left + right) / 2, y: (top + bottom) / 2, "text-anchor": "middle", class: "empty" });
    svg.append(this.empty);
    if (this.spec.time) this.inside.append(this.cursor);
    this.box.replaceChildren(svg);
    this.svg = svg;
    this.refresh();
    this.move();
  }

  get calendar() {
    return this.spec.time ? this.tab.calendar : null;
  }

  xLabel() {
    return this.calendar ? this.calendar.label : labelled(this.spec.x);
  }

  // Marks of the horizontal axis with their words, and what stands below these.
  marked() {
    const f = this.spec.x.show[1];
    if (this.calendar) {
      const most = Math.floor((this.sx.to - this.sx.from) / 80);
      return this.calendar.ticks(this.sx.low / f, this.sx.high / f, most).map(({ t, text, below }) => [t * f, text, below]);
    }
    if (this.spec.x.marks.length) return this.spec.x.marks.map(([v, words]) => [v * f, words]);
    return ticks(this.sx, 70).map((v) => [v, tickText(v)]);
  }

  stretches(top, bottom) {
    const f = this.spec.x.show[1];
    for (const [from, to] of this.spec.shades) {
      const [a, b] = [this.sx.place(from * f), this.sx.place(to * f)];
      this.inside.append(element("rect", { x: a, width: Math.max(b - a, 1.5), y: top, height: bottom - top, class: "range" }));
    }
  }

  references(left, right) {
    const f = this.spec.y.show[1];
    for (const [low, high, label] of this.spec.ranges) {
      const [a, b] = [this.sy.place(high * f), this.sy.place(low * f)];
      this.inside.append(element("rect", { x: left, width: right - left, y: a, height: Math.max(b - a, 0.5), class: "range" }));
      this.inside.append(element("text", { x: right - 4, y: a - 4, "text-anchor": "end", class: "reference" }, label));
    }
    for (const [value, label] of this.spec.levels) {
      const at = this.sy.place(value * f);
      this.inside.append(element("line", { x1: left, x2: right, y1: at, y2: at, class: "level" }));
      this.inside.append(element("text", { x: right - 4, y: at - 4, "text-anchor": "end", class: "reference" }, label));
    }
  }

  drawLines() {
    for (const line of this.lines) {
      const style = { "data-key": line.key, stroke: line.colour, fill: "none" };
      if (line.kind === "spread" && this.yAxis.scale === "linear") {
        line.mark = element("path", { ...style, d: this.whiskers(line), class: "line" });
        this.inside.append(line.mark);
      } else if (line.lower) {
        const upper = this.path(line.x, line.upper);
        line.mark = element("path", { ...style, d: this.ribbon(line), fill: line.colour, stroke: "none", class: "band" });
        this.inside.append(line.mark);
        line.edge = element("path", { ...style, d: `${upper} ${this.path(line.x, line.lower)}`, class: "edge" });
        this.inside.append(line.edge);
      } else if (line.kind === "points") {
        line.mark = element("path", { ...style, d: this.dots(line), class: "dots" });
        this.inside.append(line.mark);
      } else if (line.kind === "crosses") {
        line.mark = element("path", { d: this.crosses(line), class: "rejected" });
        this.inside.append(line.mark);
      } else if (line.kind === "bars") {
        line.mark = element("path", { ...style, d: this.sticks(line), class: "bars" });
        this.inside.append(line.mark);
      } else if (line.kind === "spans") {
        line.mark = element("path", { ...style, d: this.path(line.x, line.y), class: "bars" });
        this.inside.append(line.mark);
      } else {
        line.mark = element("path", { ...style, d: this.path(line.x, line.y), "stroke-dasharray": line.dash.join(" "), class: "line" });
        this.inside.append(line.mark);
        if (!this.spec.time) {
          line.edge = element("path", { ...style, d: this.dots(line), class: "dots large" });
          this.inside.append(line.edge);
        }
      }
    }
  }

  path(x, y) {
    let out = "";
    let pen = "M";
    for (let i = 0; i < x.length; i++) {
      if (Number.isNaN(y[i]) || (this.yAxis.scale === "log" && !(y[i] > 0))) {
        pen = "M";
        continue;
      }
      out += `${pen}${this.sx.place(x[i]).toFixed(1)} ${this.clamped(y[i])}`;
      pen = "L";
    }
    return out;
  }

  ribbon({ x, y, upper, lower }) {
    let out = "";
    for (let start = 0; start < x.length; start++) {
      if (Number.isNaN(y[start])) continue;
      let end = start;
      while (end < x.length && !Number.isNaN(y[end])) end++;
      let back = "";
      let there = "";
      for (let i = start; i < end; i++) {
        const at = this.sx.place(x[i]).toFixed(1);
        there += `${i === start ? "M" : "L"}${at} ${this.clamped(upper[i])}`;
        back = `L${at} ${this.clamped(lower[i])}${back}`;
      }
      out += `${there}${back}Z`;
      start = end;
    }
    return out;
  }

  dots({ x, y }) {
    let out = "";
    for (let i = 0; i < x.length; i++) if (!Number.isNaN(y[i])) out += `M${this.sx.place(x[i]).toFixed(1)} ${this.clamped(y[i])}h0`;
    return out;
  }

  // What is beyond the axis is shown at its edge.
  crosses({ x, y }) {
    const [top, bottom] = [this.sy.to + 5, this.sy.from - 5];
    let out = "";
    for (let i = 0; i < x.length; i++) if (!Number.isNaN(y[i])) out += cross(this.sx.place(x[i]), Math.min(Math.max(this.sy.place(y[i]), top), bottom));
    return out;
  }

  // Beside each other, because those of estimators that are alike would hide one another.
  whiskers({ x, key, lower, upper }) {
    const aside = 5 * (key - (this.tab.keys.length - 1) / 2);
    let out = "";
    for (let i = 0; i < x.length; i++) if (!Number.isNaN(lower[i])) out += `M${(this.sx.place(x[i]) + aside).toFixed(1)} ${this.clamped(lower[i])}V${this.clamped(upper[i])}m-3 0h6`;
    return out;
  }

  sticks({ x, y }) {
    const foot = this.sy.from;
    let out = "";
    for (let i = 0; i < x.length; i++) if (!Number.isNaN(y[i])) out += `M${this.sx.place(x[i]).toFixed(1)} ${foot}V${this.clamped(y[i])}`;
    return out;
  }

  // What is far outside is drawn a little outside, because large coordinates are drawn wrongly by some browsers.
  clamped(value) {
    return Math.min(Math.max(this.sy.place(value), -500), this.height + 500).toFixed(1);
  }

  refresh() {
    if (!this.svg) return;
    let any = false;
    for (const line of this.lines) {
      const shown = this.shown(line);
      any ||= shown;
      line.mark.style.display = shown ? "" : "none";
      if (line.edge) line.edge.style.display = shown ? "" : "none";
    }
    this.empty.textContent = any ? "" : "switched off in the legend";
  }

  move() {
    if (!this.svg || !this.spec.time) return;
    const at = this.sx.place(this.tab.time * this.spec.x.show[1]);
    this.cursor.setAttribute("x1", at);
    this.cursor.setAttribute("x2", at);
  }

  // Values of every line shown, at the epoch that is nearest to a time in seconds.
  at(x) {
    return this.lines
      .filter((line) => this.shown(line) && line.x.length && line.kind !== "spread")
      .map((line) => {
        const i = nearest(line.x, x);
        const note = line.notes ? line.notes.words[line.notes.of[i]] : "";
        return { line, x: line.x[i], value: line.y[i], note };
      })
      .filter(({ line, x: there }) => !loose(line) || this.lines.length < 6 || Math.abs(this.sx.place(there) - this.sx.place(x)) < 12);
  }

  table() {
    const [xs, ys] = [this.spec.x, this.spec.y].map((axis) => labelled(axis));
    const rows = [["series", ...(this.spec.time ? this.tab.timeHeads : [xs]), ys, "note"]];
    const at = (line, i) => (this.spec.time ? this.tab.timeCells(line.seconds[i]) : [line.x[i]]);
    for (const line of this.lines) {
      const name = line.name === line.label ? line.name : `${line.name}: ${line.label}`;
      line.y.forEach((y, i) => Number.isNaN(y) || rows.push([name, ...at(line, i), y, line.notes ? line.notes.words[line.notes.of[i]] : ""]));
      if (line.kind === "spread") line.lower.forEach((y, i) => Number.isNaN(y) || rows.push([`${name}, lower end`, ...at(line, i), y, ""]));
    }
    return rows;
  }

  valueAtCursor(key) {
    const line = this.lines.find((l) => l.key === key && !l.lower);
    return line && line.x.length ? line.y[nearest(line.seconds, this.tab.time)] : NaN;
  }

  described() {
    const names = [...new Set(this.lines.map((l) => l.name))].join(", ");
    return `${this.spec.title}: ${labelled(this.spec.y)} against ${this.xLabel()}; ${names}`;
  }

  xUnder(event) {
    const box = this.svg.getBoundingClientRect();
    const px = ((event.clientX - box.left) / box.width) * this.width;
    const share = Math.min(1, Math.max(0, (px - this.sx.from) / (this.sx.to - this.sx.from)));
    if (this.xAxis.scale !== "log") return this.sx.low + share * (this.sx.high - this.sx.low);
    return this.sx.low * (this.sx.high / this.sx.low) ** share;
  }

  listen() {
    const { box } = this;
    box.addEventListener("pointerdown", (event) => {
      if (this.spec.time && event.button === 0) this.from = this.xUnder(event);
    });
    box.addEventListener("pointermove", (event) => this.hover(event));
    box.addEventListener("pointerleave", () => this.leave());
    box.addEventListener("pointercancel", () => this.leave());
    box.addEventListener("pointerup", (event) => this.release(event));
    box.addEventListener("dblclick", () => this.tab.zoomTo(null));
  }

  hover(event) {
    if (!this.svg) return;
    const x = this.xUnder(event);
    const found = this.at(x);
    if (!found.length) return;
    const at = this.sx.place(found[0].x);
    for (const end of ["x1", "x2"]) this.hair.setAttribute(end, at);
    this.hair.setAttribute("visibility", "visible");
    if (this.from !== undefined && event.pointerType === "mouse") {
      const [a, b] = [this.sx.place(this.from), this.sx.place(x)];
      this.brush.setAttribute("x", Math.min(a, b));
      this.brush.setAttribute("width", Math.abs(b - a));
    }
    const [unit, xUnit] = [this.spec.y.show[0], this.spec.x.show[0]];
    const rows = found.map(({ line, value, note }) => ({
      colour: line.colour,
      name: this.spec.single || line.key < 0 ? line.label : line.name,
      value: withUnit((line.kind === "band" ? "±" : "") + number(value), unit) + (note ? `, ${note}` : ""),
    }));
    const mark = this.spec.x.marks.find(([v]) => v * this.spec.x.show[1] === found[0].x);
    const where = this.spec.time ? this.tab.when(found[0].x / this.spec.x.show[1], 4) : `${this.spec.x.label} ${mark ? mark[1] : withUnit(number(found[0].x), xUnit)}`;
    showTip(event, where, rows);
  }

  release(event) {
    if (this.from === undefined) return;
    const [a, b] = [this.from, this.xUnder(event)].sort((p, q) => p - q);
    const f = this.spec.x.show[1];
    const wide = Math.abs(this.sx.place(b) - this.sx.place(a)) > 8 && event.pointerType === "mouse";
    this.from = undefined;
    this.brush.setAttribute("width", 0);
    if (wide) this.tab.zoomTo([a / f, b / f]);
    else this.tab.moveTo(a / f);
  }

  leave() {
    this.from = undefined;
    hideTip();
    if (!this.svg) return;
    this.hair.setAttribute("visibility", "hidden");
    this.brush.setAttribute("width", 0);
  }
}

function loose(line) {
  return line.kind === "points" || line.kind === "crosses";
}

function scaled(axis, factor) {
  const times = (v) => (v === null ? null : v * factor);
  return { ...axis, low: times(axis.low), high: times(axis.high), threshold: axis.threshold * factor };
}

function labelled(axis) {
  return axis.show[0] ? `${axis.label} [${axis.show[0]}]` : axis.label;
}

function extent(arrays, axis) {
  let [low, high] = [Infinity, -Infinity];
  for (const values of arrays)
    for (const v of values)
      if (Number.isFinite(v) && !(axis.scale === "log" && v <= 0)) {
        if (v < low) low = v;
        if (v > high) high = v;
      }
  if (low > high) return axis.scale === "log" ? [0.1, 10] : [-1, 1];
  if (axis.scale === "log") return [low / 1.25, high * 1.25];
  const margin = 0.05 * (high - low) || Math.abs(high) || 1;
  return [low - margin, high + margin];
}
