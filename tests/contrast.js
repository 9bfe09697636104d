/* How many visible texts were checked, and those with a contrast below WCAG 2.1 AA (4.5, large texts 3). */
() => {
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const parsed = new Map();
  const parse = (colour) => {
    if (!parsed.has(colour)) {
      canvas.clearRect(0, 0, 1, 1);
      canvas.fillStyle = colour;
      canvas.fillRect(0, 0, 1, 1);
      const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
      parsed.set(colour, [r, g, b, a / 255]);
    }
    return parsed.get(colour);
  };
  const over = ([r, g, b, a], below) => [r, g, b].map((c, i) => a * c + (1 - a) * below[i]);
  const luminance = (rgb) => {
    const [r, g, b] = rgb.map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ratio = (a, b) => {
    const [high, low] = [luminance(a), luminance(b)].sort((x, y) => y - x);
    return (high + 0.05) / (low + 0.05);
  };
  const background = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const colour = parse(getComputedStyle(e).backgroundColor);
      if (colour[3] > 0) return colour[3] === 1 ? colour.slice(0, 3) : over(colour, background(e.parentElement));
    }
    return [255, 255, 255];
  };
  /* the filter of the dark page: invert, turn hues by 180 degrees (Filter Effects, 9.6), blend as "screen" */
  const flip = (rgb, paper) => {
    const [r, g, b] = rgb.map((c) => 1 - c / 255);
    const turned = [-0.574 * r + 1.43 * g + 0.144 * b, 0.426 * r + 0.43 * g + 0.144 * b, 0.426 * r + 1.43 * g - 0.856 * b];
    return turned.map((c) => Math.min(1, Math.max(0, c))).map((c, i) => 255 * c + paper[i] - c * paper[i]);
  };
  const found = [];
  let checked = 0;
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    const text = walker.currentNode.textContent.trim();
    if (!text || ["SCRIPT", "STYLE", "title", "desc"].includes(element.tagName) || element.closest(".skip, .said")) continue;
    if (!element.checkVisibility({ visibilityProperty: true })) continue;
    const style = getComputedStyle(element);
    /* white letters stand on the colour field of a figure, which has no background to be asked for */
    if (element.closest("svg") && style.fill === "rgb(255, 255, 255)") continue;
    const svg = element.closest("svg");
    const paper = background(svg ? svg.closest("figure") ?? svg : element);
    let front = over(parse(svg ? style.fill : style.color), svg ? [255, 255, 255] : paper);
    let back = svg ? [255, 255, 255] : paper;
    if (svg && getComputedStyle(svg).filter !== "none") [front, back] = [flip(front, paper), flip(back, paper)];
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    checked += 1;
    if (ratio(front, back) < (large ? 3 : 4.5))
      found.push(`${ratio(front, back).toFixed(2)}: ${text.slice(0, 40)} (${front.map(Math.round)} on ${back.map(Math.round)})`);
  }
  return { checked, found };
}
