/* What the page adds where scripts run: tables sort, figures say their values, a slider moves the band, light or dark.
   Everything it shows is on the page without it. */
"use strict";
(() => {
  const NOTHING = "–";
  const SUPERSCRIPTS = "⁻⁰¹²³⁴⁵⁶⁷⁸⁹";
  const make = (tag, properties = {}) => Object.assign(document.createElement(tag), properties);
  const said = make("div", { className: "said" });
  said.setAttribute("aria-live", "polite");
  const tip = make("div", { className: "tip", hidden: true });
  tip.setAttribute("aria-hidden", "true");
  document.body.append(said, tip);

  /* Light and dark: what the reader chose, else what the system prefers. */
  const theme = document.querySelector(".theme");
  const prefersDark = matchMedia("(prefers-color-scheme: dark)");
  const dark = () => (document.documentElement.dataset.theme ?? (prefersDark.matches ? "dark" : "light")) === "dark";
  const labelTheme = () => { theme.textContent = dark() ? "Light page" : "Dark page"; };
  theme.addEventListener("click", () => {
    document.documentElement.dataset.theme = dark() ? "light" : "dark";
    labelTheme();
  });
  prefersDark.addEventListener("change", labelTheme);
  labelTheme();
  theme.hidden = false;

  /* Tables: a button in every heading; ascending, descending, as it was. */
  function numeric(text) {
    const power = (_, digits) => "e" + [...digits].map((d) => "-0123456789"[SUPERSCRIPTS.indexOf(d)]).join("");
    const plain = text.replace(/−/g, "-").replace(/×10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)/, power);
    const found = /^([<>]?)[+±~\s]*(-?\d+(?:\.\d+)?(?:e-?\d+)?)(?=$|[ %(])/.exec(plain);
    return found ? Number(found[2]) * (found[1] === "<" ? 0.999 : 1) : null;
  }

  function keys(rows, column) {
    const texts = rows.map((row) => row.cells[column].textContent.trim());
    const numbers = texts.map(numeric);
    const empty = (text) => text === "" || text === NOTHING;
    const plain = texts.every((text, i) => empty(text) || numbers[i] !== null);
    return texts.map((text, i) => (empty(text) ? null : plain ? numbers[i] : text));
  }

  function compare(a, b) {
    return typeof a === "number" ? a - b : a.localeCompare(b, "en", { numeric: true });
  }

  function sort(table, original, column) {
    const heads = [...table.tHead.rows[0].cells];
    const before = heads[column].getAttribute("aria-sort");
    const order = before === "ascending" ? "descending" : before === "descending" ? "none" : "ascending";
    for (const head of heads) head.removeAttribute("aria-sort");
    let rows = original;
    if (order !== "none") {
      heads[column].setAttribute("aria-sort", order);
      const key = new Map(keys(original, column).map((value, i) => [original[i], value]));
      const sign = order === "ascending" ? 1 : -1;
      const last = (row) => (key.get(row) === null ? 1 : 0);
      rows = [...original].sort((a, b) =>
        last(a) || last(b) ? last(a) - last(b) : sign * compare(key.get(a), key.get(b)));
    }
    table.tBodies[0].append(...rows);
    said.textContent = order === "none" ? "as it was" : `sorted by ${heads[column].textContent}, ${order}`;
  }

  for (const table of document.querySelectorAll("main table")) {
    const original = [...table.tBodies[0].rows];
    if (original.length < 2) continue;
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      if (!head.textContent.trim()) return;
      const button = make("button", { type: "button", className: "sort" });
      button.append(...head.childNodes);
      button.addEventListener("click", () => sort(table, original, column));
      head.append(button);
    });
  }

  /* Figures: values under the pointer, and of the marks one by one with the arrow keys. */
  const svgElement = (svg, tag, attributes) => {
    const element = document.createElementNS(svg.namespaceURI, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    return element;
  };

  function value(scale, share) {
    const at = (low, high) => low + (high - low) * share;
    return scale.log ? Math.exp(at(Math.log(scale.low), Math.log(scale.high))) : at(scale.low, scale.high);
  }

  function share(scale, number) {
    const along = (x, low, high) => (x - low) / (high - low);
    return scale.log ? along(Math.log(number), Math.log(scale.low), Math.log(scale.high))
      : along(number, scale.low, scale.high);
  }

  function written(scale, number) {
    const step = scale.log ? Math.abs(number) / 1000 : Math.abs(scale.high - scale.low) / 1000;
    const decimals = Math.max(0, Math.min(12, Math.ceil(-Math.log10(step || 1))));
    return Number(number.toFixed(decimals)).toFixed(decimals).replace("-", "−");
  }

  function reading(axes, x, y) {
    const [left, top, width, height] = axes.box;
    const lines = [];
    if (axes.x) lines.push(`${axes.x.name}: ${written(axes.x, value(axes.x, (x - left) / width))}`);
    if (axes.y) lines.push(`${axes.y.name}: ${written(axes.y, value(axes.y, 1 - (y - top) / height))}`);
    return lines;
  }

  function readable(svg) {
    const every = JSON.parse(svg.dataset.axes);
    const inside = (x, y, slack = 0.5) => every.find(({ box: [left, top, width, height] }) =>
      x >= left - slack && x <= left + width + slack && y >= top - slack && y <= top + height + slack);
    const marks = [...svg.querySelectorAll("g[clip-path] > use")]
      .map((use) => ({ x: Number(use.getAttribute("x")), y: Number(use.getAttribute("y")) }))
      .filter((mark) => inside(mark.x, mark.y))
      .sort((a, b) => every.indexOf(inside(a.x, a.y)) - every.indexOf(inside(b.x, b.y)) || a.x - b.x || b.y - a.y);
    const ring = svgElement(svg, "circle", { class: "ring", r: 6, fill: "none", stroke: "#c8500a", "stroke-width": 1.6 });
    const holder = svg.closest(".scroll");
    const scale = () => svg.getScreenCTM();
    let chosen = -1;

    function show(x, y, mark) {
      const axes = inside(x, y);
      const lines = axes ? reading(axes, x, y) : [];
      tip.hidden = !lines.length;
      ring.remove();
      if (!lines.length) return;
      if (mark) {
        ring.setAttribute("cx", x);
        ring.setAttribute("cy", y);
        svg.append(ring);
      }
      tip.replaceChildren(...lines.map((line) => make("div", { textContent: line })));
      const at = new DOMPoint(x, y).matrixTransform(scale());
      const { width, height } = tip.getBoundingClientRect();
      tip.style.left = `${Math.max(4, Math.min(at.x + 14, innerWidth - width - 4))}px`;
      tip.style.top = `${at.y - height - 12 < 4 ? at.y + 16 : at.y - height - 12}px`;
      return lines;
    }

    function hide() {
      tip.hidden = true;
      ring.remove();
    }

    svg.addEventListener("pointermove", (event) => {
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(scale().inverse());
      const reach = 12 / scale().a;
      const away = (mark) => Math.hypot(mark.x - at.x, mark.y - at.y);
      const near = marks.reduce((best, mark) => (away(mark) < (best ? away(best) : reach) ? mark : best), null);
      show(near ? near.x : at.x, near ? near.y : at.y, near);
    });
    svg.addEventListener("pointerleave", hide);
    if (!marks.length) return;
    const name = `Figure: the left and right arrow keys read its ${marks.length} points`;
    holder.setAttribute("aria-label", name);
    holder.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (event.key === "Escape") hide();
      if (!step) return;
      event.preventDefault();
      chosen = chosen < 0 ? (step > 0 ? 0 : marks.length - 1) : (chosen + step + marks.length) % marks.length;
      const mark = marks[chosen];
      holder.scrollLeft = mark.x * scale().a - holder.clientWidth / 2;
      said.textContent = (show(mark.x, mark.y, mark) ?? []).join(", ");
    });
    holder.addEventListener("blur", hide);
  }

  for (const svg of document.querySelectorAll("figure svg[data-axes]")) readable(svg);
  addEventListener("keydown", (event) => { if (event.key === "Escape") tip.hidden = true; });

  /* Design force: a slider over the forces for which the predictions were computed. */
  function explorer(box) {
    const figure = box.closest("figure");
    const svg = figure.querySelector("svg");
    const data = JSON.parse(box.querySelector("script").textContent);
    const slider = box.querySelector("input");
    const [axes] = svg.dataset.axes ? JSON.parse(svg.dataset.axes) : [];
    const cursor = svgElement(svg, "g", { class: "cursor" });
    svg.append(cursor);

    function draw(i) {
      cursor.replaceChildren();
      if (!axes?.x || !axes.y) return;
      const [left, top, width, height] = axes.box;
      const X = left + width * share(axes.x, data.force[i]);
      const Y = (number) => Math.max(top, Math.min(top + height, top + height * (1 - share(axes.y, number))));
      const add = (tag, attributes) => cursor.append(svgElement(svg, tag, attributes));
      const holder = svg.closest(".scroll");
      holder.scrollLeft = (X * svg.clientWidth) / svg.viewBox.baseVal.width - holder.clientWidth / 2;
      add("line", { x1: X, x2: X, y1: top, y2: top + height, stroke: "#1f2328", "stroke-width": 0.8 });
      if (data.median[i] === null) return;
      const bar = (low, high, half, fill) => add("rect", {
        x: X - half, width: 2 * half, y: Y(high), height: Math.max(0, Y(low) - Y(high)), fill,
        stroke: "#0b2545", "stroke-width": 0.8 });
      bar(data.low[i], data.high[i], 5, "#cddcea");
      bar(data.credible_low[i], data.credible_high[i], 3, "#93b3d1");
      for (const [number, fill] of [[data.linear[i], "#a3123a"], [data.median[i], "#0b2545"]])
        add("circle", { cx: X, cy: Y(number), r: 4, fill, stroke: "white", "stroke-width": 1 });
    }

    function choose(i) {
      slider.value = i;
      slider.setAttribute("aria-valuetext", data.texts.force[i]);
      for (const [name, texts] of Object.entries(data.texts))
        box.querySelector(`[data-shows="${name}"]`).textContent = texts[i];
      draw(i);
    }

    slider.addEventListener("input", () => choose(Number(slider.value)));
    for (const button of box.querySelectorAll("button"))
      button.addEventListener("click", () => choose(Number(button.value)));
    svg.addEventListener("click", (event) => {
      if (!axes?.x) return;
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const force = value(axes.x, (at.x - axes.box[0]) / axes.box[2]);
      const distance = (f) => Math.abs(f - force);
      choose(data.force.reduce((best, f, i) => (distance(f) < distance(data.force[best]) ? i : best), 0));
    });
    box.hidden = false;
    choose(Number(slider.value));
  }

  for (const box of document.querySelectorAll(".explorer")) explorer(box);

  /* What does not scroll needs no stop of the Tab key, unless the arrow keys read it. */
  function stops() {
    for (const holder of document.querySelectorAll(".scroll")) {
      const needed = holder.scrollWidth > holder.clientWidth + 1 || holder.querySelector("svg[data-axes]");
      holder.tabIndex = needed ? 0 : -1;
    }
  }
  addEventListener("resize", stops);
  addEventListener("toggle", stops, true);
  stops();
})();
