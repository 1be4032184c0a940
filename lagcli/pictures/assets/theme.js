"use strict";

/* Light and dark of a page that has pictures alone: as the system has it, until the button changes it. */

(() => {
  const root = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const button = document.querySelector("#theme");
  let before = null; // what printing has changed
  const paint = (name) => {
    root.dataset.theme = name;
    button.textContent = name === "dark" ? "Light" : "Dark";
  };
  button.hidden = false;
  button.addEventListener("click", () => paint(root.dataset.theme === "dark" ? "light" : "dark"));
  dark.addEventListener("change", () => {
    const name = dark.matches ? "dark" : "light";
    if (before) before.theme = name;
    else paint(name);
  });
  paint(dark.matches ? "dark" : "light");

  addEventListener("beforeprint", () => {
    if (before) return;
    const folded = [...document.querySelectorAll("details:not([open])")];
    before = { theme: root.dataset.theme, folded };
    for (const part of folded) part.open = true;
    paint("light");
  });
  addEventListener("afterprint", () => {
    if (!before) return;
    for (const part of before.folded) part.open = false;
    paint(before.theme);
    before = null;
  });
})();
