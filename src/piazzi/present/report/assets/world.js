// What globe and map share: samples of the orbit, measurements of each station, what lies under the pointer.

const RADIUS = 6378137;

class World {
  constructor(tab, box, spec) {
    Object.assign(this, { tab, box, spec });
    this.seconds = array(spec.at);
    this.place = vectors(spec.place);
    this.turned = array(spec.turned);
    this.sun = vectors(spec.sun);
    this.covariance = vectors(spec.covariance);
    this.rows = spec.rows.map(readRows);
    this.land = ringsOf(array(spec.land));
    this.reach = Math.max(RADIUS, ...this.place.map((p) => Math.hypot(...p)).filter(Number.isFinite));
    box.addEventListener("pointermove", (event) => this.hover(event));
    box.addEventListener("pointerleave", hideTip);
  }

  refresh() {}

  get index() {
    return nearest(this.seconds, this.tab.time);
  }

  // Samples of the revolution up to the cursor.
  lately() {
    const k = this.index;
    const from = this.seconds[k] - this.spec.period;
    let first = k;
    while (first > 0 && this.seconds[first - 1] >= from) first--;
    return [first, k];
  }

  // Names of stations that do not cover one another, at their points on paper.
  names(sites) {
    const taken = [];
    const out = element("g");
    for (const [row, x, y] of sites) {
      const wide = 6.6 * row.label.length + 8;
      const left = x + 7 + wide > this.width ? x - 7 - wide : x + 7;
      const own = [left, y - 8, left + wide, y + 8];
      if (taken.some((t) => t[0] < own[2] && own[0] < t[2] && t[1] < own[3] && own[1] < t[3])) continue;
      if (own[1] < 0 || own[3] > this.height) continue;
      taken.push(own);
      out.append(element("text", { x: left + 2, y: y + 4, class: "reference label" }, row.label));
    }
    return out;
  }

  hover(event) {
    if (!this.svg || this.grip) return;
    const [px, py] = under(event, this.svg, this.width);
    let best = null;
    for (const spot of this.spots()) {
      const d = Math.hypot(spot.x - px, spot.y - py);
      if (d < 14 && (!best || d + spot.rank < best.d)) best = { ...spot, d: d + spot.rank };
    }
    if (!best) return hideTip();
    showTip(event, best.title, best.lines);
  }

  // Stations, measurements and samples with where they are on paper; a smaller rank wins.
  spots() {
    const out = [];
    for (const row of this.rows) {
      if (row.site) {
        const at = this.onPaper(row.site, null);
        if (at) out.push({ x: at[0], y: at[1], rank: -6, title: row.label, lines: [{ colour: row.colour, name: "station", value: degrees(row.site) }] });
      }
      row.place.forEach((p, i) => {
        const at = Number.isNaN(p[0]) ? null : this.onPaper(p, row.turned[i]);
        if (at) out.push({ x: at[0], y: at[1], rank: row.used[i] ? -3 : -4, title: this.tab.when(row.seconds[i]), lines: row.tip(i) });
      });
    }
    this.place.forEach((p, i) => {
      const at = this.onPaper(p, this.turned[i]);
      const height = withUnit(number((Math.hypot(...p) - RADIUS) / 1000), "km");
      if (at) out.push({ x: at[0], y: at[1], rank: 0, title: this.tab.when(this.seconds[i]), lines: [{ colour: "var(--ink)", name: degrees(p), value: `${height} up` }] });
    });
    return out;
  }

  table() {
    const rows = [["series", ...this.tab.timeHeads, "x [m]", "y [m]", "z [m]", "note"]];
    this.place.forEach((p, i) => rows.push(["orbit, fixed to the Earth", ...this.tab.timeCells(this.seconds[i]), ...p, ""]));
    for (const row of this.rows) row.place.forEach((p, i) => Number.isNaN(p[0]) || rows.push([row.label, ...this.tab.timeCells(row.seconds[i]), ...p, row.note(i)]));
    return rows;
  }
}

function readRows(spec) {
  const row = { ...spec, seconds: array(spec.at), place: vectors(spec.place), turned: array(spec.turned), used: array(spec.used) };
  row.note = (i) => (spec.notes ? spec.notes.words[spec.notes.of[i]] : "");
  row.tip = (i) => [{ colour: spec.colour, name: spec.label, value: row.used[i] ? row.note(i) || "used" : `not used: ${row.note(i)}` }];
  return row;
}

function vectors(indices) {
  const columns = indices.map(array);
  return Array.from(columns[0], (_, i) => columns.map((column) => column[i]));
}

// Unit vectors of every ring of longitudes and latitudes in degrees.
function ringsOf(values) {
  const out = [];
  let ring = [];
  for (let i = 0; i < values.length; i += 2) {
    if (Number.isNaN(values[i])) {
      out.push(ring);
      ring = [];
    } else ring.push([values[i], values[i + 1]]);
  }
  return out;
}

function unitOf([longitude, latitude]) {
  const [l, p] = [(longitude * Math.PI) / 180, (latitude * Math.PI) / 180];
  return [Math.cos(p) * Math.cos(l), Math.cos(p) * Math.sin(l), Math.sin(p)];
}

function lonLat([x, y, z]) {
  return [(Math.atan2(y, x) * 180) / Math.PI, (Math.atan2(z, Math.hypot(x, y)) * 180) / Math.PI];
}

function degrees(place) {
  const [l, p] = lonLat(place);
  return `${Math.abs(p).toFixed(1)}° ${p < 0 ? "S" : "N"}, ${Math.abs(l).toFixed(1)}° ${l < 0 ? "W" : "E"}`;
}

function under(event, svg, width) {
  const box = svg.getBoundingClientRect();
  return [((event.clientX - box.left) / box.width) * width, ((event.clientY - box.top) / box.width) * width];
}

function cross(x, y, r = 3.5) {
  return `M${(x - r).toFixed(1)} ${(y - r).toFixed(1)}l${2 * r} ${2 * r}m${-2 * r} 0l${2 * r} ${-2 * r}`;
}
