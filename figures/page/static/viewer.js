// Two images of a figure with a split between them, what is under the pointer magnified, differences and spectra.
const element = (name, attributes = {}, ...children) => {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key in made) made[key] = value; else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
};

// What a figure handed out, by sampler and samples per pixel.
const collection = (root) => {
  const data = JSON.parse(root.querySelector("script").textContent);
  const [reference, ...items] = data.items;
  const counts = [...new Set(items.map((item) => item.spp))].filter((spp) => spp !== undefined);
  counts.sort((a, b) => a - b);
  const file = (item, kind) => `${root.dataset.name}.${item[kind]}`;
  return {
    ...data, reference, counts,
    modes: Object.fromEntries(Object.entries(exported).filter(([kind]) => items.some((item) => item[kind]))),
    samplers: [...new Set(items.map((item) => item.name))],
    find: (name, spp) => name === reference.name ? reference : items.find((item) => item.name === name && item.spp === spp),
    // The reference has neither a difference nor a spectrum: it is shown itself.
    url: (item, kind) => encodeURI(file(item, item[kind] ? kind : "file")),
    alt: (item, kind) => `${root.dataset.title}: ${kind === "file" || !item[kind] ? "" : `${kind} of `}${item.name}`
      + (item.spp === undefined ? "" : ` at ${item.spp} samples per pixel`)
      + (item.rms === undefined ? "" : `, RMS difference ${error(item)}`),
  };
};
const error = (item) => item.rms.toPrecision(3);
const modes = { file: "Image", difference: "Difference", spectrum: "Spectrum" };
const exported = { file: "Image", difference: "Difference", filtered: "Filtered", spectrum: "Spectrum" };
const errors = (item) => item.rms === undefined ? ""
  : `RMS ${error(item)}${item.filtered_rms === undefined ? "" : `, filtered ${error({ rms: item.filtered_rms })}`}`;
const explained = (kind, item) => ({
  file: "",
  difference: item.scale === undefined ? "" : `Difference: mid-grey is none, white +${item.scale}, black −${item.scale}`,
  filtered: item.filtered_scale === undefined ? "" : "Difference after a Gaussian of 1.5 pixels, as from a distance: "
    + `mid-grey is none, white +${item.filtered_scale}, black −${item.filtered_scale}`,
  spectrum: "Power spectrum of the difference, frequency 0 in the middle; black is 0.01 of white noise, white 100 times",
})[kind];

let groups = 0;
const choiceOfModes = (changed, offered = modes, start = "file") => {
  const group = `mode-${groups++}`;
  return element("span", { className: "modes", role: "radiogroup", "aria-label": "Show" },
    ...Object.entries(offered).map(([kind, label]) => element("label", {},
      element("input", { type: "radio", name: group, value: kind, checked: kind === start, onchange: () => changed(kind) }),
      label)));
};
const choiceOfCount = (counts, start, changed) => {
  const told = element("output");
  const slider = element("input", {
    type: "range", min: 0, max: counts.length - 1, step: 1, value: start, "aria-label": "Samples per pixel", className: "spp",
  });
  const tell = () => {
    told.textContent = `${counts[slider.value]} spp`;
    slider.setAttribute("aria-valuetext", told.textContent);
  };
  slider.addEventListener("input", () => { tell(); changed(counts[slider.value]); });
  tell();
  return element("label", { className: "samples" }, "Samples per pixel", slider, told);
};

const LENS = 32; // pixels of the image that are magnified, a side
const STAGE = 512;
const PANEL = 256;

for (const root of document.querySelectorAll(".viewer")) {
  const images = collection(root);
  const { width, height } = images;
  const names = [images.reference.name, ...images.samplers];
  const lens = Math.min(LENS, width, height);
  let [mode, spp, zoom] = ["file", images.counts[0], 1];
  let near = false; // images of a figure far below are not read
  let place = [Math.floor((width - lens) / 2), Math.floor((height - lens) / 2)];

  const select = (label, chosen) => element("select", { "aria-label": label, onchange: () => show() },
    ...names.map((name) => element("option", { selected: name === chosen }, name)));
  const selects = [select("Left of the split", names[1]), select("Right of the split", names[2] ?? names[0])];
  const picture = (name) => element("img", { className: name, loading: "lazy" });
  const [left, right] = [picture("over"), picture("")];
  const line = element("div", { className: "line" });
  const frame = element("div", { className: "lens" });
  const split = element("input", {
    type: "range", className: "split", min: 0, max: width, step: 1, value: Math.round(width / 2),
    "aria-label": "Split between the images: arrow keys move it",
  });
  const stage = element("div", { className: "stage" }, right, left, frame, line, split);
  const note = element("p", { className: "stage-note" });
  const sides = ["left", "right"].map((side) => {
    const parts = {
      head: element("h4"),
      magnified: element("div", {
        className: "magnified", tabIndex: 0, role: "img",
      }),
      difference: picture(""), spectrum: picture(""),
      notes: [element("p"), element("p"), element("p")],
    };
    parts.box = element("div", { className: `panel ${side}` }, parts.head, parts.magnified, parts.notes[0],
      element("div", { className: "scroll", tabIndex: -1 }, parts.difference), parts.notes[1],
      element("div", { className: "scroll", tabIndex: -1 }, parts.spectrum), parts.notes[2]);
    return parts;
  });
  const controls = element("div", { className: "controls" },
    element("label", {}, "Left", selects[0]), element("label", {}, "Right", selects[1]),
    choiceOfModes((kind) => { mode = kind; show(); }, images.modes));
  if (images.counts.length) controls.append(choiceOfCount(images.counts, 0, (count) => { spp = count; show(); }));
  root.append(controls, element("div", { className: "scroll", tabIndex: -1 }, stage, note),
    element("div", { className: "sides" }, ...sides.map((side) => side.box)));

  const chosen = () => selects.map((each) => images.find(each.value, spp));
  const divide = () => {
    const part = (100 * split.value) / width;
    left.style.clipPath = `inset(0 ${100 - part}% 0 0)`;
    line.style.left = `${part}%`;
    split.setAttribute("aria-valuetext", `${Math.round(part)} % ${selects[0].value}, the rest ${selects[1].value}`);
  };
  const magnify = () => {
    const each = pixels.fitting(lens, Math.min(PANEL, (root.clientWidth - 24) / 2));
    for (const [k, item] of chosen().entries()) {
      const { magnified } = sides[k];
      magnified.style.width = magnified.style.height = pixels.css(lens, each);
      if (near) magnified.style.backgroundImage = `url("${images.url(item, mode)}")`;
      magnified.style.backgroundSize = `${pixels.css(width, each)} ${pixels.css(height, each)}`;
      magnified.style.backgroundPosition = `-${pixels.css(place[0], each)} -${pixels.css(place[1], each)}`;
      sides[k].notes[0].textContent = `${lens} x ${lens} pixels from (${place.join(", ")}), ${each} ×`;
      magnified.setAttribute("aria-label", `${item.name}, magnified; arrow keys move what is magnified`);
    }
    frame.style.left = pixels.css(place[0], zoom);
    frame.style.top = pixels.css(place[1], zoom);
    frame.style.width = frame.style.height = pixels.css(lens, zoom);
  };
  const move = (x, y) => {
    place = [[x, width], [y, height]].map(([at, end]) => Math.min(end - lens, Math.max(0, Math.round(at))));
    magnify();
  };
  const show = () => {
    const items = chosen();
    for (const [image, item] of [[left, items[0]], [right, items[1]]]) {
      image.src = images.url(item, mode);
      image.alt = images.alt(item, mode);
    }
    for (const [k, item] of items.entries()) {
      const { head, difference, spectrum, notes } = sides[k];
      head.replaceChildren(item.name, " ",
        element("small", {}, errors(item)));
      for (const [kind, image, text] of [["difference", difference, notes[1]], ["spectrum", spectrum, notes[2]]]) {
        image.hidden = item[kind] === undefined;
        text.textContent = image.hidden ? "" : explained(kind, item);
        if (image.hidden) continue;
        image.src = images.url(item, kind);
        image.alt = images.alt(item, kind);
      }
    }
    note.textContent = `${width} x ${height} pixels, ${zoom} ×: ${images.transfer}. ${explained(mode, items[1])}`;
    divide();
    magnify();
  };
  const layout = () => {
    const space = root.clientWidth;
    zoom = pixels.fitting(width, Math.min(STAGE, space));
    const small = pixels.fitting(width, Math.min(PANEL, (space - 24) / 2));
    for (const image of [left, right]) {
      image.style.width = pixels.css(width, zoom);
      image.style.height = pixels.css(height, zoom);
    }
    for (const { difference, spectrum } of sides) {
      for (const image of [difference, spectrum]) {
        image.style.width = pixels.css(width, small);
        image.style.height = pixels.css(height, small);
      }
    }
    show();
  };
  split.addEventListener("input", divide);
  stage.addEventListener("pointermove", (event) => {
    const box = stage.getBoundingClientRect();
    const at = (distance) => (distance * pixels.ratio()) / zoom - lens / 2;
    move(at(event.clientX - box.left), at(event.clientY - box.top));
  });
  for (const { magnified } of sides) {
    magnified.addEventListener("keydown", (event) => {
      const step = event.shiftKey ? 8 : 1;
      const by = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] }[event.key];
      if (!by) return;
      event.preventDefault();
      move(place[0] + by[0], place[1] + by[1]);
    });
  }
  layouts.push(layout);
  layout();
  new IntersectionObserver((entries, observer) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    near = true;
    magnify();
  }, { rootMargin: "800px" }).observe(root);
}
