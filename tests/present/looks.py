"""What is asked of every page: names for screen readers, letters that stand out, headings in order, no scrolling sideways."""

from itertools import pairwise
from typing import Any

UNNAMED = """() => [...document.querySelectorAll("button, input, select, a, [tabindex], svg[role=img]")].filter((e) =>
  !(e.getAttribute("aria-label") || e.getAttribute("aria-labelledby") || e.textContent.trim() || e.closest("label")))
  .map((e) => e.outerHTML.slice(0, 120))"""
CONTRAST = """() => { const parse = (c) => { const m = c.match(/[\\d.]+/g).map(Number); return [m[0], m[1], m[2], m[3] ?? 1]; };
  const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  const light = (c) => { const [r, g, b] = c.slice(0, 3).map((v) => linear(v / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const paper = (e) => { for (let n = e; n; n = n.parentElement) {
    const c = parse(getComputedStyle(n).backgroundColor); if (c[3] === 1) return c; } };
  const out = [];
  for (const e of document.querySelectorAll("body *")) {
    if (e.closest("noscript, script, #tip, .cells") || !e.checkVisibility({ visibilityProperty: true })) continue;
    if (![...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim())) continue;
    const svg = e instanceof SVGElement; const ink = parse(svg ? getComputedStyle(e).fill : getComputedStyle(e).color);
    const [a, b] = [light(ink), light(paper(e))]; const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) out.push([e.tagName, e.className.baseVal ?? e.className, e.textContent.slice(0, 30), ratio]);
  } return out; }"""
ORDER = "() => [...document.querySelectorAll('h1, h2, h3, h4')].map((h) => Number(h.tagName[1]))"
UNREACHED = """() => [...document.querySelectorAll("button, input, select, .scroll")].filter((e) =>
  e.checkVisibility() && e.tabIndex < 0 && e.getAttribute("role") !== "tab").map((e) => e.outerHTML.slice(0, 120))"""


def check_looks(page: Any) -> None:
    """Of a page that is open, with all that is folded."""
    page.evaluate("() => document.querySelectorAll('details').forEach((d) => (d.open = true))")
    page.evaluate("async () => { for (let i = 0; i < 3; i++) await new Promise(requestAnimationFrame); }")
    assert page.evaluate(UNNAMED) == []
    assert page.evaluate(UNREACHED) == []
    assert page.evaluate(CONTRAST) == []
    levels = page.evaluate(ORDER)
    assert levels[0] == 1 and all(b - a <= 1 for a, b in pairwise(levels))
    assert page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
