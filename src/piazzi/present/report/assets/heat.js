// A cell for every value of two axes, with its number in it.

class Heat {
  constructor(tab, box, spec) {
    Object.assign(this, { tab, box, spec });
    box.addEventListener("pointermove", (event) => this.hover(event));
    box.addEventListener("pointerleave", hideTip);
  }

  refresh() {}

  move() {}

  draw(width) {
    this.width = width;
    const { cells, marks, labels } = this.spec;
    const [columns, rows] = marks.map((m) => m.length);
    const tall = Math.min(44, Math.max(22, 260 / rows));
    const height = (this.height = Math.round(26 + rows * tall + 40));
    this.left = 14 + 7 * Math.max(3, ...marks[1].map((t) => t.length));
    this.wide = (width - 12 - this.left) / columns;
    this.tall = tall;
    const bottom = (this.bottom = height - 38);
    const named = `${this.spec.title}: ${this.spec.measure} over ${labels[0]} and ${labels[1]}`;
    this.svg = element("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": named });
    const inside = element("g", { class: "cells" });
    const fits = 7 * Math.max(...cells.flat().map((c) => c[2].length)) < this.wide;
    cells.forEach((row, j) =>
      row.forEach(([colour, letters, text], i) => {
        const [x, y] = [this.left + i * this.wide, bottom - (j + 1) * tall];
        inside.append(element("rect", { x, y, width: this.wide + 0.5, height: tall + 0.5, style: `fill:${colour}` }));
        if (fits) inside.append(element("text", { x: x + this.wide / 2, y: y + tall / 2 + 4, "text-anchor": "middle", style: `fill:${letters}` }, text));
      })
    );
    const grid = element("g", { class: "grid-lines" });
    const apart = Math.max(1, Math.ceil((7 * Math.max(...marks[0].map((t) => t.length)) + 8) / this.wide));
    marks[0].forEach((text, i) => i % apart || grid.append(element("text", { x: inward(this.left + (i + 0.5) * this.wide, text, width), y: bottom + 17, "text-anchor": "middle" }, text)));
    marks[1].forEach((text, j) => grid.append(element("text", { x: this.left - 6, y: bottom - (j + 0.5) * tall + 4, "text-anchor": "end" }, text)));
    this.svg.append(inside, grid);
    this.svg.append(element("text", { x: 2, y: 13, class: "label" }, labels[1]));
    this.svg.append(element("text", { x: width - 12, y: height - 4, "text-anchor": "end", class: "label" }, labels[0]));
    this.box.replaceChildren(this.svg);
  }

  hover(event) {
    if (!this.svg) return;
    const [x, y] = under(event, this.svg, this.width);
    const { cells, marks, labels, measure } = this.spec;
    const [i, j] = [Math.floor((x - this.left) / this.wide), Math.floor((this.bottom - y) / this.tall)];
    const cell = cells[j]?.[i];
    if (!cell) return hideTip();
    showTip(event, `${labels[0]} = ${marks[0][i]}, ${labels[1]} = ${marks[1][j]}`, [{ colour: cell[0], name: measure, value: cell[2] }]);
  }

  table() {
    const { cells, marks, labels, measure } = this.spec;
    return [[...labels, measure], ...cells.flatMap((row, j) => row.map((cell, i) => [marks[0][i], marks[1][j], cell[2] === "-" ? "" : cell[2]]))];
  }
}
