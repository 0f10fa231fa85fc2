// All samplers beside each other, at as many samples per pixel as the slider says.
const GAP = 16;
for (const root of document.querySelectorAll(".wall")) {
  const images = collection(root);
  const { width, height, counts } = images;
  let [mode, spp] = ["filtered" in images.modes ? "filtered" : "file", counts[0]];
  const tiles = [images.reference.name, ...images.samplers].map((name) => {
    const tile = { name, image: element("img", { loading: "lazy" }), told: element("small") };
    tile.box = element("figure", {}, tile.image, element("h4", {}, name, " ", tile.told));
    return tile;
  });
  const note = element("p");
  root.append(
    element("div", { className: "controls" },
      choiceOfCount(counts, 0, (count) => { spp = count; show(); }),
      choiceOfModes((kind) => { mode = kind; show(); }, images.modes, mode)),
    element("div", { className: "tiles" }, ...tiles.map((tile) => tile.box)), note);
  const show = () => {
    let last;
    for (const { name, image, told } of tiles) {
      const item = images.find(name, spp);
      image.src = images.url(item, mode);
      image.alt = images.alt(item, mode);
      told.textContent = errors(item);
      last = item;
    }
    note.textContent = explained(mode, last);
  };
  const layout = () => {
    const zoom = pixels.fitting(width, Math.min(PANEL, (root.clientWidth - GAP) / 2)); // two in a row at least
    root.style.setProperty("--tile", pixels.css(width, zoom));
    for (const { image } of tiles) {
      image.style.width = pixels.css(width, zoom);
      image.style.height = pixels.css(height, zoom);
    }
  };
  layouts.push(layout);
  layout();
  show();
}
