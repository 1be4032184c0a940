"use strict";

/* A picture of the gallery moves while it is looked at. */
const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
for (const picture of still ? [] : document.querySelectorAll("img[data-film]")) {
  const { src } = picture;
  const play = () => (picture.src = picture.dataset.film);
  const stop = () => (picture.src = src);
  const link = picture.closest("a");
  link.addEventListener("pointerenter", play);
  link.addEventListener("pointerleave", stop);
  link.addEventListener("focus", play);
  link.addEventListener("blur", stop);
}
