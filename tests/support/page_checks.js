"use strict";

/* What a machine can see of a page; page_checks.py evaluates these functions in it. */

/* Colours: of a text or null, over others, behind an element, and the contrast of two (WCAG 2.1). */
const pen = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
const parse = (text) => {
  pen.fillStyle = "#010203";
  pen.fillStyle = text;
  if (pen.fillStyle === "#010203") return null; // what a canvas does not understand, it ignores
  pen.clearRect(0, 0, 1, 1);
  pen.fillRect(0, 0, 1, 1);
  const [r, g, b, a] = pen.getImageData(0, 0, 1, 1).data;
  return { rgb: [r, g, b], a: a / 255 };
};
const over = ({ rgb, a }, below) => rgb.map((x, i) => a * x + (1 - a) * below[i]);
const scheme = getComputedStyle(document.documentElement).colorScheme;
const night = matchMedia("(prefers-color-scheme: dark)").matches && !matchMedia("print").matches;
// what browsers show where no element has a background
const bare = night && scheme.includes("dark") ? [18, 18, 18] : [255, 255, 255];
const behind = (box) => {
  const layers = [];
  for (let at = box; at; at = at.parentElement) {
    const layer = parse(getComputedStyle(at).backgroundColor) ?? { a: 0 };
    if (layer.a) layers.push(layer);
    if (layer.a === 1) break;
  }
  return layers.reduceRight((below, layer) => over(layer, below), bare);
};
const luminance = (rgb) => {
  const part = (x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4);
  return 0.2126 * part(rgb[0]) + 0.7152 * part(rgb[1]) + 0.0722 * part(rgb[2]);
};
const ratio = (text, below) => {
  const ink = parse(text);
  if (!ink) return 0;
  const [one, other] = [luminance(over(ink, below)), luminance(below)];
  return (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
};
const seen = (box) =>
  box.checkVisibility({ visibilityProperty: true, opacityProperty: true, contentVisibilityAuto: true });

/** Returns pairs of texts of a page that overlap, and texts that are cut off or beyond the window. */
function texts() {
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const found = [], wrong = [];
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const box = node.parentElement;
    if (!node.data.trim() || box.closest("math, option, script, style, pre, code, .skip")) continue;
    if (!box.checkVisibility({ visibilityProperty: true, contentVisibilityAuto: true })) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    let scrolls = box; // sideways: what is beyond its edge can be reached
    while (scrolls && getComputedStyle(scrolls).overflowX !== "auto")
      scrolls = scrolls.parentElement;
    // the names of controls end in an ellipsis
    const hides = scrolls || box.closest(".control-name, .control-note span, .balance-label, .plot-label");
    let clipping = box; // what is beyond it is reached by scrolling up and down
    while (clipping && getComputedStyle(clipping).overflowY === "visible") clipping = clipping.parentElement;
    const clip = clipping?.getBoundingClientRect() ?? { top: -Infinity, bottom: Infinity, right: Infinity };
    for (const { left, right, top, bottom, width, height } of range.getClientRects()) {
      if (width < 2 || height < 2 || getComputedStyle(box).clipPath !== "none") continue;
      if (!hides && (left < -1 || right > innerWidth + 1)) wrong.push(["outside", node.data]);
      if (bottom > clip.bottom + 1 || top < clip.top - 1) continue;
      found.push({ node, left, right: hides ? Math.min(right, clip.right, innerWidth) : right, top, bottom });
    }
  }
  for (const [i, a] of found.entries())
    for (const b of found.slice(i + 1)) {
      if (a.node === b.node) continue;
      const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (across > 2 && down > 4) wrong.push(["overlap", a.node.data, b.node.data]);
    }
  for (const box of document.querySelectorAll("button, summary, th, td")) {
    const shown = box.checkVisibility() && getComputedStyle(box).display !== "inline";
    if (shown && box.clientWidth && box.scrollWidth > box.clientWidth + 1)
      wrong.push(["cut off", box.textContent]);
  }
  return wrong;
}

/** Returns the charts whose numbers or labels have no space: upright numbers that touch, a label that is longer than its axis, fewer than two numbers. */
function axes() {
  const wrong = [], pen = document.createElement("canvas").getContext("2d");
  pen.font = "12px system-ui, sans-serif";
  const plots = [...document.querySelectorAll("figure.plot")].map(({ plot }) => plot);
  for (const { chart, container, data, upright } of plots) {
    if (!container.checkVisibility()) continue;
    const [, y] = chart.axes, label = upright.textContent;
    const places = y._splits.filter((v, i) => v !== null && y._values[i]);
    const at = places.map((v) => chart.valToPos(v, "y")).sort((a, b) => a - b);
    if (at.length < 2) wrong.push(["few numbers", label, y._values]);
    if (at.some((p, i) => i && p - at[i - 1] < 11)) wrong.push(["numbers touch", label]);
    const widest = Math.max(...y._values.map((text) => pen.measureText(text ?? "").width));
    if (widest + 15 > y._size - 20) wrong.push(["number under the label", label, y._values]);
    if (upright.scrollHeight > upright.clientHeight) wrong.push(["label cut off", label]);
    if (!label) wrong.push(["no label", data.title]);
    const letters = label.normalize("NFD").replace(/\p{M}/gu, "");
    if (/(^|, )[^ _]{1,2}_|'/.test(letters)) wrong.push(["not typeset", label]);
  }
  return wrong;
}

/** Returns the texts whose contrast with what is behind them is less than 4.5, or 3 where they are large (WCAG 2.1, 1.4.3); but for what is disabled, or of a run before an error. */
function contrast() {
  const OLD = ".stale :not(#notice), .stale ~ #more";
  const NOT = `option, script, style, noscript, .skip, :disabled, ${OLD}`;
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const wrong = new Set();
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const box = node.parentElement;
    if (!node.data.trim() || box.closest(NOT) || !seen(box)) continue;
    const style = getComputedStyle(box);
    const paper = behind(box);
    let opacity = 1;
    for (let at = box; at; at = at.parentElement) opacity *= getComputedStyle(at).opacity;
    const ink = parse(style.color);
    const found = ratio(`rgb(${ink.rgb.join(" ")} / ${ink.a * opacity})`, paper);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
    const text = node.data.trim().slice(0, 40);
    if (found < (large ? 3 : 4.5)) wrong.add(`${found.toFixed(2)} ${box.tagName} ${text}`);
  }
  return [...wrong];
}

/** Returns the graphics whose contrast with what is behind them is less than 3 (WCAG 2.1, 1.4.11): curves, bars, arrows and bodies, sliders, the edges of fields, and lines and texts of pictures; and grids that are as strong as curves. Trails and guides may be faint. */
function graphics() {
  const wrong = new Set();
  const check = (colour, below, what, least = 3) => {
    const found = ratio(colour, below);
    if (found < least) wrong.add(`${found.toFixed(2)} ${what} ${colour}`);
  };
  for (const { plot } of document.querySelectorAll("figure.plot, div.plot")) {
    if (!plot || !seen(plot.container)) continue;
    const paper = behind(plot.container);
    for (const button of plot.buttons)
      check(button.style.getPropertyValue("--series"), paper, "curve");
    const [axis] = plot.chart.axes;
    check(axis.stroke(), paper, "numbers of an axis", 4.5);
    const grid = ratio(axis.grid.stroke(), paper);
    if (!(grid > 1 && grid < 2)) wrong.add(`${grid.toFixed(2)} grid ${axis.grid.stroke()}`);
  }
  for (const { player } of document.querySelectorAll(".player")) {
    const { colors, data } = player?.stage ?? {};
    if (!colors) continue;
    const faint = ["paper", "trail", "guide"];
    for (const [role, colour] of Object.entries(colors))
      if (!faint.includes(role)) check(colour, parse(colors.paper).rgb, role, role === "label" ? 4.5 : 3);
    for (const colour of Object.values(data.colors ?? {})) check(colour, parse(colors.paper).rgb, "force");
  }
  for (const field of document.querySelectorAll("input, textarea")) {
    if (!seen(field) || field.disabled || ["checkbox", "radio", "file"].includes(field.type)) continue;
    const style = getComputedStyle(field), paper = behind(field.parentElement);
    if (field.type !== "range") check(style.borderTopColor, paper, "edge of a field");
    else if (style.accentColor !== "auto") check(style.accentColor, paper, "slider");
  }
  for (const bar of document.querySelectorAll(".balance-swatch, .balance-segment, .plot-swatch")) {
    if (!seen(bar) || bar.closest(".emphasized")) continue;
    const style = getComputedStyle(bar), filled = parse(style.backgroundColor).a;
    check(filled ? style.backgroundColor : style.borderTopColor, behind(bar.parentElement), bar.className);
  }
  for (const shape of document.querySelectorAll("svg rect, svg path")) {
    const { fill, stroke } = getComputedStyle(shape);
    if (!seen(shape) || (fill === "none" && stroke === "none")) continue;
    check(fill === "none" ? stroke : fill, behind(shape.closest("svg")), "svg");
  }
  // pictures: what is filled or drawn in them, but for grids, legends' frames and shades
  for (const image of document.querySelectorAll("img[src^='data:image/svg']")) {
    if (!seen(image)) continue;
    const text = new TextDecoder().decode(Uint8Array.from(atob(image.src.split(",")[1]), (c) => c.charCodeAt(0)));
    const svg = new DOMParser().parseFromString(text, "image/svg+xml");
    const whole = svg.querySelector("[id='patch_1'] path, rect");
    const paper = parse(whole?.style.fill || whole?.getAttribute("fill") || "white").rgb;
    for (const shape of svg.querySelectorAll("path, use, line, polyline, polygon")) {
      if (shape.closest("defs, clipPath, [id^='legend'] > [id^='patch'], [id^='drawn-']")) continue;
      if (shape.closest("[id^='matplotlib.axis']") && !shape.closest("[id^='text']")) continue;
      const own = shape.style.stroke || shape.getAttribute("stroke") || "none";
      const opacity = shape.style.opacity || shape.style.strokeOpacity || shape.getAttribute("opacity") || 1;
      const wide = parseFloat(shape.style.strokeWidth || shape.getAttribute("stroke-width") || 1);
      if (own !== "none" && opacity > 0.9 && wide >= 1) check(own, paper, `line of a picture`);
    }
  }
  return [...wrong];
}

/** Return what one knows of an element with the focus. */
function described(at) {
  const { left, top, width, height } = at.getBoundingClientRect();
  const style = getComputedStyle(at);
  // only these are named by what they contain
  const named = at.matches("a, button, summary");
  const content = named ? at.textContent + (at.querySelector("img")?.alt ?? "") : "";
  const words = [at.ariaLabel, content, at.labels?.[0]?.textContent, at.title];
  const name = (words.find((text) => text?.trim()) ?? "").trim();
  const ring = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) > 0;
  const auto = style.outlineStyle === "auto"; // the browser's own, of two colours
  const outlined = ring && (auto || ratio(style.outlineColor, behind(at.parentElement)) >= 3);
  const place = [...document.querySelectorAll("*")].indexOf(at);
  return { name, place, tag: at.tagName, top: top + scrollY, left, width, height, outlined };
}

/**
 * Goes to the beginning of a page, from which the Tab key starts, and notes what gets the focus: its
 * name, its place, whether one sees that it has it, and where it is.
 */
function first() {
  window.reached = [];
  document.addEventListener("focusin", ({ target }) => window.reached.push(described(target)));
  const start = document.createElement("span");
  start.tabIndex = -1;
  document.body.prepend(start);
  start.focus();
  start.remove();
  window.reached.length = 0;
  scrollTo(0, 0);
}

/** Returns what got the focus, and whether it has left the page, or begun again. */
function focused() {
  const { reached } = window;
  const again = reached.findIndex(({ place }, i) => i && place === reached[0].place);
  const ended = again > 1 || document.activeElement === document.body || !reached.length;
  return { reached: again > 0 ? reached.slice(0, again) : reached, ended };
}

/** Returns how many elements the keyboard should reach. */
function reachable() {
  return [...document.querySelectorAll(
    "a[href], button, input, select, textarea, summary, [tabindex]",
  )].filter((e) => e.tabIndex >= 0 && !e.disabled && !e.closest("[inert]") &&
    e.checkVisibility({ visibilityProperty: true }) && e.type !== "file").length;
}

/** Returns what moves by itself. */
async function moving() {
  const wrong = [];
  const pictures = () => [...document.querySelectorAll("canvas")].map((c) => c.width && c.toDataURL());
  const before = pictures();
  await new Promise((done) => setTimeout(done, 120));
  pictures().forEach((picture, i) => picture !== before[i] && wrong.push(["canvas", i]));
  for (const animation of document.getAnimations())
    if (animation.playState === "running") wrong.push(["animation", animation.effect?.target?.outerHTML]);
  const moving = "video[autoplay], marquee, img[src$='.gif']";
  for (const box of document.querySelectorAll(moving))
    if (box.checkVisibility({ visibilityProperty: true })) wrong.push(["moving picture", box.outerHTML.slice(0, 80)]);
  if (getComputedStyle(document.documentElement).scrollBehavior === "smooth") wrong.push(["scrolling"]);
  return wrong;
}

/** Returns what should not be on paper: a dark background, controls, what is folded, cut off or distorted. */
function paper() {
  const wrong = [];
  const paper = behind(document.body);
  if (luminance(paper) < 0.9) wrong.push(["dark", String(paper)]);
  for (const box of document.querySelectorAll("button, input, textarea, select, video, iframe")) {
    if (!seen(box)) continue;
    const style = getComputedStyle(box);
    const edge = style.borderTopStyle !== "none" && parseFloat(style.borderTopWidth) > 0;
    const looks = style.appearance !== "none" && !["", "none"].includes(style.appearance) && box.tagName !== "BUTTON";
    const framed = edge && (parse(style.borderTopColor)?.a ?? 0) > 0;
    const text = ["text", "number"].includes(box.type) && !framed;
    if ((framed || looks) && !text) wrong.push(["control", box.outerHTML.slice(0, 90)]);
  }
  for (const box of document.querySelectorAll("details:not([open])"))
    if (seen(box)) wrong.push(["folded", box.textContent.trim().slice(0, 40)]);
  for (const box of document.querySelectorAll("canvas, img")) {
    if (!seen(box) || !box.clientWidth) continue;
    const [wide, high] = [box.naturalWidth ?? box.width, box.naturalHeight ?? box.height];
    const shown = (box.clientWidth / box.clientHeight) / (wide / high);
    if (Math.abs(shown - 1) > 0.03 && getComputedStyle(box).objectFit !== "contain")
      wrong.push(["distorted", box.outerHTML.slice(0, 90), shown]);
  }
  for (const box of document.querySelectorAll("body *")) {
    const style = getComputedStyle(box);
    if (style.overflowX === "visible" || style.display === "inline" || style.clipPath !== "none") continue;
    if (!seen(box) || box.tagName === "INPUT" || box.clientWidth < 2) continue;
    if (box.scrollWidth > box.clientWidth + 2) wrong.push(["cut off", box.tagName, box.className, box.textContent.slice(0, 60)]);
  }
  const { scrollWidth } = document.documentElement;
  if (scrollWidth > innerWidth + 1) wrong.push(["wider than paper", scrollWidth, innerWidth]);
  return wrong;
}

