// Every drawing as a file: its own picture with the colours that it has, or its numbers.

function listenToSaving(tab) {
  tab.root.addEventListener("click", (event) => {
    const button = event.target.closest("button.save");
    if (!button) return;
    const drawing = tab.drawings.find((d) => d.box === button.closest("figure").querySelector(".plot"));
    if (!drawing.svg) drawing.draw(540);
    const name = drawing.spec.title.replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "").toLowerCase() || "chart";
    const as = button.dataset.as;
    if (as === "csv") keep(new Blob([csv(drawing.table())], { type: "text/csv" }), `${name}.csv`);
    else if (as === "svg") keep(new Blob([alone(drawing)], { type: "image/svg+xml" }), `${name}.svg`);
    else painted(drawing, (blob) => keep(blob, `${name}.png`));
  });
}

function keep(blob, name) {
  const link = element("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// Text that a spreadsheet takes for a formula begins with a quote.
function csv(rows) {
  const cell = (value) => {
    if (typeof value === "number") return Number.isFinite(value) ? String(value) : "";
    const text = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
    return /[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  return rows.map((row) => row.map(cell).join(",")).join("\n") + "\n";
}

const LOOKS = ["fill", "fill-opacity", "stroke", "stroke-width", "stroke-dasharray", "stroke-linecap", "stroke-linejoin", "opacity", "display", "visibility", "font-size", "font-family", "font-weight", "text-anchor", "paint-order"];

// The picture with its looks written into it, for what does not read the page's.
function alone(drawing) {
  const copy = drawing.svg.cloneNode(true);
  const [from, to] = [drawing.svg, copy].map((svg) => [svg, ...svg.querySelectorAll("*")]);
  from.forEach((mark, i) => {
    const look = getComputedStyle(mark);
    for (const name of LOOKS) to[i].setAttribute(name, look.getPropertyValue(name));
    for (const name of ["class", "style", "tabindex"]) to[i].removeAttribute(name);
  });
  for (const [name, value] of [["xmlns", "http://www.w3.org/2000/svg"], ["width", drawing.width], ["height", drawing.height]]) copy.setAttribute(name, value);
  const paper = getComputedStyle(document.documentElement).getPropertyValue("--card");
  copy.prepend(element("rect", { width: drawing.width, height: drawing.height, fill: paper }));
  return new XMLSerializer().serializeToString(copy);
}

// Three points of a picture for each of the page.
function painted(drawing, then) {
  const image = new Image();
  image.onload = () => {
    const canvas = element("canvas", { width: 3 * drawing.width, height: 3 * drawing.height });
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    canvas.toBlob(then, "image/png");
  };
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(alone(drawing))}`;
}
