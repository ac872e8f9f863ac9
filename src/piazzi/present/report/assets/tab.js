// One problem: what is shown, which epoch, which stretch of time; charts follow.

class Tab {
  constructor(spec) {
    this.id = spec.id;
    this.root = document.getElementById(spec.id);
    this.keys = spec.keys;
    this.show = spec.show;
    this.calendar = spec.calendar && new Calendar(spec.calendar);
    this.visible = new Set(spec.keys.keys());
    this.focus = 0;
    this.times = spec.times === null ? new Float64Array([0]) : array(spec.times);
    this.index = this.times.length - 1;
    this.time = this.times[this.index];
    this.zoom = null;
    const last = this.times[this.times.length - 1];
    const margin = 0.01 * (last - this.times[0]) || 0.5;
    this.span = [this.times[0] - margin, last + margin];
    const find = (selector) => this.root.querySelector(selector);
    [this.slider, this.output, this.button] = ["input.time", ".clock", ".play"].map(find);
    [this.select, this.whole, this.everyone] = [".focus select", ".unzoom", ".everyone"].map(find);
    this.drawings = [...this.root.querySelectorAll(".plot")].map((box) => {
      const drawing = spec.drawings[box.dataset.drawing];
      return new { orbit: Orbit, chart: Chart, globe: Globe, map: WorldMap, sky: Sky, heat: Heat }[drawing.kind](this, box, drawing);
    });
    listenToSaving(this);
    this.columns = this.drawings.filter((d) => d.spec.column);
    this.listed();
    this.listen();
    this.refresh();
    this.moveTo(this.time);
  }

  listen() {
    this.slider?.addEventListener("input", () => {
      this.stop();
      this.moveTo(this.times[Number(this.slider.value)]);
    });
    this.button?.addEventListener("click", () => (this.timer ? this.stop() : this.play()));
    this.whole?.addEventListener("click", () => {
      this.zoomTo(null);
      this.slider?.focus();
    });
    this.everyone?.addEventListener("click", () => {
      this.visible = new Set(this.visible.size ? [] : this.keys.keys());
      this.refresh();
    });
    this.select?.addEventListener("change", () => {
      this.focus = Number(this.select.value);
      this.visible.add(this.focus);
      this.refresh();
    });
    for (const chip of this.root.querySelectorAll(".chip")) chip.addEventListener("click", () => this.toggle(Number(chip.dataset.key)));
    const watch = new ResizeObserver((entries) => {
      for (const entry of entries) {
        const drawing = this.drawings.find((d) => d.box === entry.target);
        const width = Math.round(entry.contentRect.width);
        if (width > 0 && width !== drawing.width) drawing.draw(width);
      }
    });
    for (const drawing of this.drawings) {
      if (!drawing.box.closest("details:not([open])")) drawing.draw(Math.round(drawing.box.clientWidth) || 540);
      watch.observe(drawing.box);
    }
    for (const fold of this.root.querySelectorAll("details")) fold.addEventListener("toggle", () => this.unfolded(fold));
  }

  // What is folded is drawn when it is opened.
  unfolded(fold) {
    for (const drawing of this.drawings) if (fold.open && fold.contains(drawing.box)) drawing.draw(Math.round(drawing.box.clientWidth) || 540);
  }

  // Hidden ones too; on paper they are smaller than on a screen, and their letters are not.
  drawAll(width) {
    for (const drawing of this.drawings) drawing.draw(width || Math.round(drawing.box.clientWidth) || 540);
  }

  toggle(key) {
    if (this.visible.has(key)) this.visible.delete(key);
    else this.visible.add(key);
    if (!this.visible.has(this.focus) && this.visible.size) this.focus = Math.min(...this.visible);
    this.refresh();
  }

  refresh() {
    for (const chip of this.root.querySelectorAll(".chip")) chip.setAttribute("aria-pressed", this.visible.has(Number(chip.dataset.key)));
    for (const row of this.root.querySelectorAll("tr[data-key]")) row.classList.toggle("off", !this.visible.has(Number(row.dataset.key)));
    if (this.select) this.select.value = this.focus;
    if (this.everyone) this.everyone.textContent = this.visible.size ? "Hide all" : "Show all";
    for (const drawing of this.drawings) drawing.refresh();
  }

  moveTo(time) {
    this.index = nearest(this.times, time);
    this.time = this.times[this.index];
    if (this.slider) {
      this.slider.value = this.index;
      this.slider.setAttribute("aria-valuetext", this.clock());
      this.output.textContent = this.clock();
    }
    for (const drawing of this.drawings) drawing.move();
    this.fill();
  }

  clock() {
    return this.when(this.time, 4);
  }

  // A time of the run, as a date where there are dates.
  when(seconds, digits = 5) {
    if (this.calendar) return this.calendar.text(seconds, this.span[1] - this.span[0]);
    return withUnit(number(seconds * this.show[1], digits), this.show[0]);
  }

  // Heads of the columns of time in a table, and what stands in them.
  get timeHeads() {
    return this.calendar ? [this.calendar.label, "time [s]"] : ["time [s]"];
  }

  timeCells(seconds) {
    return this.calendar ? [this.calendar.stamp(seconds), seconds] : [seconds];
  }

  zoomTo(range) {
    this.zoom = range;
    if (this.whole) this.whole.hidden = range === null;
    for (const drawing of this.drawings) if (drawing.spec.time && drawing.width) drawing.draw(drawing.width);
  }

  // The whole run takes twenty seconds, from the start where it is at the end.
  play() {
    if (this.index === this.times.length - 1) this.moveTo(this.times[0]);
    const rate = (this.times[this.times.length - 1] - this.times[0]) / 20000;
    let before = performance.now();
    let time = this.time;
    const step = (now) => {
      time += (now - before) * rate;
      before = now;
      this.moveTo(time);
      if (this.index === this.times.length - 1) this.stop();
      else this.timer = requestAnimationFrame(step);
    };
    this.timer = requestAnimationFrame(step);
    this.told(true);
  }

  stop() {
    if (this.timer) cancelAnimationFrame(this.timer);
    this.timer = null;
    this.told(false);
  }

  told(playing) {
    if (!this.button) return;
    this.button.textContent = playing ? "Pause" : "Play";
    this.button.setAttribute("aria-pressed", playing);
  }

  // The table of values at the cursor: a row for every legend entry, a column for every chart that has one.
  listed() {
    const table = this.root.querySelector("table.now");
    if (!table || !this.columns.length) return;
    const head = element("tr", {}, element("th", { scope: "col" }, "estimator"));
    for (const { spec } of this.columns) {
      const cell = element("th", { scope: "col" }, spec.column);
      if (spec.y.show[0]) cell.append(element("small", {}, spec.y.show[0]));
      head.append(cell);
    }
    const rows = this.keys.map((key, i) => {
      const row = element("tr", { "data-key": i }, element("th", { scope: "row" }, swatch(key.colour), key.label));
      for (const _ of this.columns) row.append(element("td"));
      return row;
    });
    table.append(element("thead", {}, head), element("tbody", {}, ...rows));
    this.now = table;
  }

  fill() {
    if (!this.now) return;
    for (const row of this.now.tBodies[0].rows)
      this.columns.forEach((chart, c) => (row.cells[c + 1].textContent = number(chart.valueAtCursor(Number(row.dataset.key)))));
  }
}

function swatch(colour) {
  return element("span", { class: "swatch", style: `background:${colour}` });
}
