// Where a value is on paper: linear, logarithmic, or linear about zero and logarithmic beyond; and which values are marked.

function scaleOf(axis, low, high, from, to) {
  const bend = bender(axis);
  const [a, b] = [bend(low), bend(high)];
  const span = b - a || 1;
  const place = (value) => from + ((bend(value) - a) / span) * (to - from);
  return { place, low, high, from, to, axis };
}

function bender(axis) {
  if (axis.scale === "log") return (v) => Math.log10(Math.max(v, 1e-300));
  if (axis.scale !== "symmetric" || !(axis.threshold > 0)) return (v) => v;
  const t = axis.threshold;
  return (v) => (Math.abs(v) <= t ? v / t : Math.sign(v) * (1 + Math.log10(Math.abs(v) / t)));
}

function ticks(scale, room) {
  const count = Math.max(2, Math.floor(Math.abs(scale.to - scale.from) / room));
  if (scale.axis.scale === "log" && scale.high > 8 * scale.low) return decades(scale.low, scale.high, count);
  if (scale.axis.scale === "symmetric" && scale.axis.threshold > 0) return bothSides(scale, count);
  let step = roundStep((scale.high - scale.low) / count); // on a logarithmic scale that is less than a decade too
  while (Math.floor(scale.high / step) - Math.ceil(scale.low / step) < 1) step = roundStep(step / 2.6); // one mark is no scale; the next smaller
  const out = [];
  for (let i = Math.ceil(scale.low / step - 1e-9); i * step <= scale.high + 1e-9 * step; i++) out.push(i * step);
  return out;
}

function roundStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((m) => m * power >= rough * 0.999);
}

function decades(low, high, count) {
  const first = Math.ceil(Math.log10(low) - 1e-9);
  const last = Math.floor(Math.log10(high) + 1e-9);
  const every = Math.max(1, Math.ceil((last - first + 1) / count));
  const out = [];
  for (let p = first - 1; p <= last; p += 1) {
    const between = last - first < 2 ? [1, 2, 5] : [1];
    for (const m of between) if ((p - first) % every === 0 || between.length > 1) out.push(m * 10 ** p);
  }
  return out.filter((v) => v >= low * 0.999 && v <= high * 1.001);
}

function bothSides(scale, count) {
  const first = Math.ceil(Math.log10(scale.axis.threshold / 1.5));
  const last = Math.floor(Math.log10(scale.high));
  const every = Math.max(1, Math.ceil((2 * (last - first + 1) + 1) / Math.max(count, 3)));
  const out = [0];
  for (let p = last; p >= first; p -= every) out.push(10 ** p, -(10 ** p));
  return out;
}

// Where the middle of a text is, so that it does not leave the picture.
function inward(at, text, width) {
  const half = 3.6 * text.length;
  return Math.min(Math.max(at, half), width - half);
}

// 1000 and 0.01 as they are, 10 to some power where that is shorter.
function tickText(value, step) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(step ? 1 : 0).replace(".0e", "e").replace("e+", "e").replace("-", "−");
  return String(Number(value.toPrecision(6))).replace("-", "−");
}
