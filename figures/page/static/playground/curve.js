// Error over samples, both axes logarithmic: two lines, and the slope of independent random samples.
const drawing = (name, attributes, ...children) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
};

const LEFT = 70; // pixels for labels
const BELOW = 38;
const ABOVE = 1.2; // as much above the first error is the slope of random samples

// Numbers with one digit, 1, 2 or 5, that are between two others.
const ticks = (least, largest) => {
  const found = [];
  for (let power = Math.floor(Math.log10(least)); 10 ** power <= largest; power++) {
    found.push(...[1, 2, 5].map((digit) => Number(`${digit}e${power}`)));
  }
  return found.filter((each) => each >= least && each <= largest);
};

// Return the contents of an SVG for lines, each a name of a class and a list of [samples, error].
const curve = (lines, most, width, height) => {
  const errors = lines.flatMap(([, points]) => points.map(([, error]) => error)).filter((error) => error > 0);
  const [least, largest] = errors.length ? [Math.min(...errors), Math.max(...errors)] : [0.01, 0.1];
  const [low, high] = [Math.log10(least / 1.4), Math.log10(largest * 1.4)];
  const x = (samples) => LEFT + ((width - LEFT - 14) * Math.log2(samples)) / Math.max(1, Math.log2(most));
  const y = (error) => 10 + ((height - 10 - BELOW) * (high - Math.log10(error))) / (high - low);
  const text = (at, up, anchor, words) => drawing("text", { x: at, y: up, "text-anchor": anchor }, words);
  const made = [];
  for (const error of ticks(10 ** low, 10 ** high)) {
    made.push(drawing("path", { class: "grid", d: `M${LEFT} ${y(error)}H${width - 14}` }),
      text(LEFT - 8, y(error) + 4, "end", String(error)));
  }
  for (let samples = 1; samples <= most; samples *= 4) {
    made.push(drawing("path", { class: "grid", d: `M${x(samples)} 10V${height - BELOW}` }),
      text(x(samples), height - BELOW + 17, "middle", String(samples)));
  }
  made.push(text((LEFT + width - 14) / 2, height - 4, "middle", "samples per pixel"));
  made.push(drawing("text", { class: "name", "text-anchor": "middle", transform: `translate(14 ${(height - BELOW) / 2}) rotate(-90)` },
    "RMS error"));
  const first = lines.map(([, points]) => points[0]).find((point) => point && point[0] === 1 && point[1] > 0);
  if (first && most > 1) {
    // One over the root of the number of samples, above the lines, as long as it is above the least error.
    const at = (samples) => `${x(samples)} ${y((ABOVE * first[1]) / Math.sqrt(samples))}`;
    const end = Math.min(most, (first[1] / 10 ** low) ** 2);
    made.push(drawing("path", { class: "slope", d: `M${at(1)}L${at(end)}` }),
      text(width - 18, 26, "end", "dashed: slope of random samples"));
  }
  for (const [name, points] of lines) {
    const seen = points.filter(([, error]) => error > 0).map(([samples, error]) => [x(samples).toFixed(1), y(error).toFixed(1)]);
    if (seen.length) made.push(drawing("path", { class: `line ${name}`, d: `M${seen.map((point) => point.join(" ")).join("L")}` }));
    made.push(...seen.map(([cx, cy]) => drawing("circle", { class: name, cx, cy, r: 3.2 })));
  }
  return made;
};
