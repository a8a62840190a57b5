"use strict";
// The page is complete without this script; it adds the filter, tooltips and the viewer.
const all = (selector, root = document) => [...root.querySelectorAll(selector)];
const one = (selector, root = document) => root.querySelector(selector);
let view = "0";

// Filter: blocks of other strata are hidden, and marks of frames outside of the stratum.
function choose(number) {
  view = number;
  for (const block of all("[data-view]")) block.toggleAttribute("hidden", block.dataset.view !== view);
  for (const mark of all("circle[data-in]")) mark.toggleAttribute("hidden", !within(mark));
  turn(0);
}
const within = (mark) => mark.dataset.in.split(" ").includes(view);
one("#filter").hidden = false;
one("#view").addEventListener("change", (event) => choose(event.target.value));

// On a telephone, maps and charts are shown of one method; the style hides the others there.
function narrow(method) {
  for (const part of all("[data-of]")) part.classList.toggle("other", part.dataset.of !== method);
}
one("#method").hidden = false;
one("#of").addEventListener("change", (event) => narrow(event.target.value));
narrow(one("#of").value);

// Tooltips, also by touch and by keyboard.
const tip = one("#tip");
function show(event) {
  const mark = event.target.closest && event.target.closest("[data-t]");
  tip.hidden = !mark;
  if (!mark) return;
  tip.textContent = mark.dataset.t;
  const box = mark.getBoundingClientRect();
  const x = event.clientX ?? box.right, y = event.clientY ?? box.bottom;
  tip.style.left = `${Math.max(4, Math.min(x + 12, innerWidth - tip.offsetWidth - 8))}px`;
  tip.style.top = `${y + 16 + tip.offsetHeight > innerHeight ? y - tip.offsetHeight - 10 : y + 16}px`;
}
for (const kind of ["pointerover", "pointerdown", "focusin"]) document.addEventListener(kind, show);
document.addEventListener("keydown", (event) => { if (event.key === "Escape") tip.hidden = true; });
document.addEventListener("scroll", () => { tip.hidden = true; }, { passive: true });

// Viewer of the worst frames.
const viewer = one(".viewer"), pick = one(".pick");
let position = 0;
function turn(step) {
  const frames = all(".worst", viewer);
  const chosen = frames.filter((frame) => frame.dataset.method === pick.value && within(frame));
  position = chosen.length ? (position + step + chosen.length) % chosen.length : 0;
  for (const frame of frames) frame.hidden = frame !== chosen[position];
  one(".none", viewer).hidden = chosen.length > 0;
  one(".position", viewer).textContent = chosen.length ? `${position + 1} of ${chosen.length}` : "none";
}
function change(step) {
  const count = pick.options.length;
  pick.selectedIndex = (pick.selectedIndex + step + count) % count;
  position = 0;
  turn(0);
}
function overlay() {
  const plain = viewer.classList.toggle("plain");
  one(".toggle", viewer).setAttribute("aria-pressed", String(!plain));
}
const actions = {
  ArrowLeft: () => turn(-1), ArrowRight: () => turn(1),
  ArrowUp: () => change(-1), ArrowDown: () => change(1), o: overlay,
};
viewer.addEventListener("keydown", (event) => {
  if (!(event.key in actions) || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.target === pick && event.key !== "o") return;
  event.preventDefault();
  actions[event.key]();
});
for (const button of all("[data-step]", viewer)) button.addEventListener("click", () => turn(+button.dataset.step));
one(".toggle", viewer).addEventListener("click", overlay);
pick.addEventListener("change", () => change(0));
one(".controls", viewer).hidden = false;
turn(0);
