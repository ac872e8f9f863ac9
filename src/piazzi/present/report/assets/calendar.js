// A clock beside seconds past an instant: what it shows, and which of its readings are marked on an axis.

const DAY = 86400;
const STEPS = [1, 2, 5, 10, 15, 30, ...[1, 2, 5, 10, 15, 30].map((m) => 60 * m), ...[1, 2, 3, 6, 12].map((h) => 3600 * h), ...[1, 2, 5, 10].map((d) => DAY * d)];
const MONTHS = [1, 2, 3, 6, 12, 24, 60, 120, 240, 600, 1200];
const MONTH_NAMES = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];

class Calendar {
  constructor({ scale, zero, leaps }) {
    Object.assign(this, { scale, zero, leaps });
    this.label = `time [${scale}]`;
  }

  // What the clock shows, in milliseconds since 1970; it stands still for a second where one is inserted.
  reading(seconds) {
    return this.zero + 1000 * (seconds - this.leaps.filter((leap) => seconds >= leap).length);
  }

  past(reading) {
    const seconds = (reading - this.zero) / 1000;
    return this.leaps.reduce((t, leap) => (t >= leap - 1e-6 ? t + 1 : t), seconds);
  }

  // A date with as many decimals of the second as matter over a stretch of time.
  text(seconds, span) {
    const decimals = span > 7200 ? 0 : span > 20 ? 1 : 3;
    const unit = 10 ** (3 - decimals);
    const iso = new Date(Math.round(this.reading(seconds) / unit) * unit).toISOString();
    return `${iso.slice(0, 10)} ${iso.slice(11, decimals ? 20 + decimals : 19)} ${this.scale}`;
  }

  stamp(seconds) {
    return new Date(Math.round(this.reading(seconds))).toISOString().slice(0, 23);
  }

  // Marks at round readings between two times: seconds, words, and the day or the year below where it is new.
  ticks(low, high, most) {
    const [first, last] = [this.reading(low) / 1000, this.reading(high) / 1000];
    const marks = this.marks(first, last, Math.max(most, 2)).map(([at, text, below]) => ({ t: this.past(1000 * at), text, below }));
    const found = marks.filter(({ t }) => t >= low - 1e-4 && t <= high + 1e-4);
    const shown = found.map(({ below }, i) => (i && below === found[i - 1].below ? "" : below));
    if (shown[1]) shown[0] = "";
    return found.map((mark, i) => ({ ...mark, below: shown[i] }));
  }

  marks(first, last, most) {
    const span = last - first;
    const iso = (at) => new Date(Math.round(1000 * at)).toISOString();
    const monthly = (text) => `${MONTH_NAMES[Number(text.slice(5, 7)) - 1]}`;
    let step = STEPS.find((s) => span / s <= most);
    if (span / most > STEPS.at(-1) && span < 70 * DAY) step = 20 * DAY;
    if (step === undefined) {
      const every = MONTHS.find((m) => span / (m * 30.44 * DAY) <= most) ?? MONTHS.at(-1);
      const [from, to] = [first, last].map((at) => Number(iso(at).slice(0, 4)) * 12 + Number(iso(at).slice(5, 7)) - 1);
      const out = [];
      for (let m = Math.ceil(from / every) * every; m <= to; m += every) {
        const at = Date.UTC(Math.floor(m / 12), m % 12) / 1000;
        out.push(every >= 12 ? [at, iso(at).slice(0, 4), ""] : [at, monthly(iso(at)), iso(at).slice(0, 4)]);
      }
      return out;
    }
    if (span / most < 0.5) step = roundStep(Math.max(span / most, 0.001));
    const begin = step >= DAY ? 0 : DAY * Math.floor(first / DAY);
    const out = [];
    for (let i = Math.ceil((first - begin) / step - 1e-6); begin + i * step <= last + 1e-6 * step; i++) {
      const at = begin + i * step;
      const text = iso(at);
      const decimals = step >= 1 ? 0 : Math.min(3, Math.ceil(-Math.log10(step)));
      if (step >= DAY) out.push([at, `${monthly(text)} ${Number(text.slice(8, 10))}`, text.slice(0, 4)]);
      else out.push([at, text.slice(11, step >= 60 ? 16 : decimals ? 20 + decimals : 19), text.slice(0, 10)]);
    }
    return out;
  }
}
