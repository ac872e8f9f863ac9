// The page: tabs, light and dark, the tip at the pointer.

const TIP = document.getElementById("tip");

function showTip(event, title, rows) {
  const lines = rows.map(({ colour, name, value }) => element("div", {}, swatch(colour), element("span", {}, name), element("b", {}, value)));
  TIP.replaceChildren(element("strong", {}, title), ...lines);
  TIP.style.display = "block";
  const [w, h] = [TIP.offsetWidth, TIP.offsetHeight];
  const x = event.clientX + 16 + w > innerWidth ? event.clientX - w - 12 : event.clientX + 16;
  const y = Math.min(event.clientY + 12, innerHeight - h - 8);
  TIP.style.transform = `translate(${Math.max(4, x)}px, ${Math.max(4, y)}px)`;
}

function hideTip() {
  TIP.style.display = "none";
}

function listenToTheme() {
  const button = document.getElementById("theme");
  const prefers = matchMedia("(prefers-color-scheme: dark)");
  const set = (dark) => {
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    button.textContent = dark ? "Light" : "Dark";
    button.setAttribute("aria-pressed", dark);
    button.setAttribute("aria-label", dark ? "Switch to light colours" : "Switch to dark colours");
  };
  set(prefers.matches);
  prefers.addEventListener("change", () => set(prefers.matches));
  button.addEventListener("click", () => set(document.documentElement.dataset.theme !== "dark"));
}

// Points of a grid, of which each is made when it is picked first; what is switched off stays so.
function listenToPicker(nav) {
  const roots = DATA.tabs.map((spec) => document.getElementById(spec.id));
  const lists = [...nav.querySelectorAll("select")];
  const buttons = [...nav.querySelectorAll("button")];
  const missing = element("span", { class: "remark", role: "status" });
  nav.append(missing);
  let last = null;
  const choose = (chosen) => {
    missing.textContent = chosen < 0 ? "This point is not on the page." : "";
    if (chosen < 0) return;
    roots.forEach((root, i) => root.classList.toggle("away", i !== chosen));
    TABS.forEach((tab) => tab.stop());
    const at = DATA.tabs[chosen].at.length > 0;
    TABS[chosen] ??= new Tab(DATA.tabs[chosen]);
    if (at && last && last !== TABS[chosen]) {
      TABS[chosen].visible = new Set(last.visible);
      TABS[chosen].refresh();
    }
    if (at) last = TABS[chosen];
    for (const button of buttons) button.setAttribute("aria-pressed", button.dataset.tab === (at ? "at" : String(chosen)));
  };
  const pick = () => choose(DATA.tabs.findIndex(({ at }) => at.length && at.every(([, value], i) => lists[i].value === value)));
  for (const list of lists) list.addEventListener("change", pick);
  for (const button of buttons) button.addEventListener("click", () => (button.dataset.tab === "at" ? pick() : choose(Number(button.dataset.tab))));
  choose(0);
}

function listenToTabs(tabs) {
  const buttons = [...document.querySelectorAll("[role=tab]")];
  const choose = (chosen) => {
    buttons.forEach((button, i) => {
      button.setAttribute("aria-selected", i === chosen);
      button.tabIndex = i === chosen ? 0 : -1;
      tabs[i].root.classList.toggle("away", i !== chosen);
      if (i !== chosen) tabs[i].stop();
    });
  };
  buttons.forEach((button, i) => {
    tabs[i].root.setAttribute("role", "tabpanel");
    button.addEventListener("click", () => choose(i));
    button.addEventListener("keydown", (event) => {
      const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!move) return;
      const next = (i + move + buttons.length) % buttons.length;
      choose(next);
      buttons[next].focus();
    });
  });
  if (buttons.length) choose(0);
}

const PICKER = document.querySelector(".picker");
const TABS = PICKER ? [] : DATA.tabs.map((spec) => new Tab(spec));
listenToTheme();
if (PICKER) listenToPicker(PICKER);
else listenToTabs(TABS);
addEventListener("beforeprint", () => {
  for (const fold of document.querySelectorAll("details")) fold.open = true;
  DATA.tabs.forEach((spec, i) => (TABS[i] ??= new Tab(spec)).drawAll(400));
});
addEventListener("afterprint", () => TABS.forEach((tab) => tab.drawAll()));
document.documentElement.dataset.ready = "true";
