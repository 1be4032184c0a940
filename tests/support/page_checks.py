"""What a machine can see of a page: texts that overlap or are cut off, axes without space."""

#: Returns pairs of texts of a page that overlap, and texts that are cut off or beyond the window.
TEXTS = """() => {
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
    const hides = scrolls || box.closest(".control-name, .control-note span");
    for (const { left, right, top, bottom, width, height } of range.getClientRects()) {
      if (width < 2 || height < 2 || getComputedStyle(box).clipPath !== "none") continue;
      if (!hides && (left < -1 || right > innerWidth + 1)) wrong.push(["outside", node.data]);
      found.push({ node, left, right: hides ? Math.min(right, innerWidth) : right, top, bottom });
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
}"""

#: Returns the charts whose numbers or labels have no space: upright numbers that touch, a label
#: that is longer than its axis, fewer than two numbers.
AXES = """() => {
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
    const letters = label.normalize("NFD").replace(/\\p{M}/gu, "");
    if (/(^|, )[^ _]{1,2}_|'/.test(letters)) wrong.push(["not typeset", label]);
  }
  return wrong;
}"""

#: Returns the texts whose contrast with what is behind them is less than 4.5, or 3 where they are
#: large (WCAG 2.1, 1.4.3); but for what is disabled, or of a run before an error.
CONTRAST = """() => {
  const OLD = ".stale :not(#notice), .stale ~ #more";
  const NOT = `option, script, style, .skip, :disabled, ${OLD}`;
  const parse = (text) => {
    const [r, g, b, a = 1] = text.match(/[\\d.]+/g).map(Number);
    const whole = text.startsWith("color(") ? 255 : 1; // a mixed colour has parts up to 1
    return { rgb: [r, g, b].map((x) => whole * x), a };
  };
  const over = ({ rgb, a }, below) => rgb.map((x, i) => a * x + (1 - a) * below[i]);
  const behind = (box) => {
    const layers = [];
    for (let at = box; at; at = at.parentElement) {
      const layer = parse(getComputedStyle(at).backgroundColor);
      if (layer.a) layers.push(layer);
      if (layer.a === 1) break;
    }
    return layers.reduceRight((below, layer) => over(layer, below), [255, 255, 255]);
  };
  const luminance = (rgb) => {
    const part = (x) => (x / 255 <= 0.04045 ? x / 255 / 12.92 : ((x / 255 + 0.055) / 1.055) ** 2.4);
    return 0.2126 * part(rgb[0]) + 0.7152 * part(rgb[1]) + 0.0722 * part(rgb[2]);
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const wrong = new Set();
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const box = node.parentElement;
    if (!node.data.trim() || box.closest(NOT)) continue;
    if (!box.checkVisibility({ visibilityProperty: true, opacityProperty: true })) continue;
    const style = getComputedStyle(box);
    const paper = behind(box);
    let opacity = 1;
    for (let at = box; at; at = at.parentElement) opacity *= getComputedStyle(at).opacity;
    const ink = parse(style.color);
    const [one, other] = [luminance(over({ ...ink, a: ink.a * opacity }, paper)), luminance(paper)];
    const ratio = (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && style.fontWeight >= 700);
    const text = node.data.trim().slice(0, 40);
    if (ratio < (large ? 3 : 4.5)) wrong.add(`${ratio.toFixed(2)} ${box.tagName} ${text}`);
  }
  return [...wrong];
}"""

#: Returns what has the focus: its name, its place, and whether one sees that it has it.
FOCUSED = """() => {
  const at = document.activeElement;
  if (at === document.body) return null;
  const { left, top, width, height } = at.getBoundingClientRect();
  const style = getComputedStyle(at);
  const name = (at.ariaLabel || at.textContent || at.labels?.[0]?.textContent || "").trim();
  const outlined = style.outlineStyle !== "none" && parseFloat(style.outlineWidth) > 0;
  const place = [...document.querySelectorAll("*")].indexOf(at);
  return { name, place, tag: at.tagName, top: top + scrollY, left, width, height, outlined };
}"""
