"use strict";
// Arrays of the page: [start, step, count], text of 24-bit floats, text of doubles, or the root of summed squares of others.

const DATA = JSON.parse(document.getElementById("data").textContent);
const ARRAYS = [];

function array(index) {
  if (!(index in ARRAYS)) ARRAYS[index] = decoded(DATA.pool[index]);
  return ARRAYS[index];
}

function decoded(entry) {
  if (Array.isArray(entry)) return Float64Array.from({ length: entry[2] }, (_, i) => entry[0] + i * entry[1]);
  if (typeof entry === "string") return floats(bytes(entry));
  if (entry.double !== undefined) return new Float64Array(bytes(entry.double).buffer);
  const parts = entry.length.map(array);
  return Float64Array.from(parts[0], (_, i) => Math.sqrt(parts.reduce((sum, part) => sum + part[i] * part[i], 0)));
}

function bytes(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
}

function floats(raw) {
  const count = raw.length / 3;
  const bits = new Uint32Array(count);
  for (let i = 0; i < count; i++) bits[i] = (raw[3 * i] << 8) | (raw[3 * i + 1] << 16) | (raw[3 * i + 2] << 24);
  return Float64Array.from(new Float32Array(bits.buffer));
}

// Index of the value nearest to x in an increasing array.
function nearest(values, x) {
  let low = 0;
  let high = values.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle;
    else high = middle;
  }
  return Math.abs(values[low] - x) <= Math.abs(values[high] - x) ? low : high;
}

// Four digits, without an exponent where the size is ordinary.
function number(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent < -4 || exponent >= 6) return value.toExponential(digits - 1).replace("-", "−").replace("e+", "e");
  return value.toFixed(Math.max(digits - 1 - exponent, 0)).replace("-", "−");
}

function withUnit(text, unit) {
  return unit && text !== "–" ? `${text} ${unit}` : text;
}

function element(name, attributes = {}, ...children) {
  const svg = ["svg", "g", "path", "line", "circle", "ellipse", "text", "rect", "clipPath", "defs", "title"].includes(name);
  const out = svg ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) out.setAttribute(key, value);
  for (const child of children) out.append(child);
  return out;
}
