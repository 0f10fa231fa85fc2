// One pixel of a picture is a whole number of pixels of the screen, whatever the screen's own scale.
const pixels = {
  ratio: () => window.devicePixelRatio || 1,
  // As many pixels of the screen as keep an image within some width; at least one.
  fitting: (size, width) => Math.max(1, Math.floor((width * pixels.ratio()) / size + 1e-6)),
  css: (size, zoom) => `${(size * zoom) / pixels.ratio()}px`,
};
const layouts = [];
{
  let ratio = pixels.ratio();
  let width = innerWidth;
  addEventListener("resize", () => {
    if (ratio === pixels.ratio() && width === innerWidth) return;
    ratio = pixels.ratio();
    width = innerWidth;
    for (const layout of layouts) layout();
  });
}
for (const figure of document.querySelectorAll(".zoomable")) {
  const image = figure.querySelector("img");
  const [width, height] = [image.width, image.height];
  let zoom = Math.max(1, Math.round(pixels.ratio()));
  const box = figure.querySelector(".zoom");
  const button = (sign, name, step) => {
    const made = document.createElement("button");
    Object.assign(made, { type: "button", textContent: sign });
    made.setAttribute("aria-label", name);
    made.addEventListener("click", () => { zoom = Math.min(16, Math.max(1, zoom + step)); layout(); });
    return made;
  };
  const told = document.createElement("output");
  box.append(button("−", "Smaller", -1), told, button("+", "Larger", 1));
  const layout = () => {
    image.style.width = pixels.css(width, zoom);
    image.style.height = pixels.css(height, zoom);
    figure.style.setProperty("--width", `calc(${image.style.width} + 2px)`);
    told.textContent = `${zoom} ×`;
  };
  layouts.push(layout);
  layout();
}
for (const button of document.querySelectorAll(".copy")) {
  button.addEventListener("click", async () => {
    const code = button.previousElementSibling;
    try {
      await navigator.clipboard.writeText(code.textContent);
      button.textContent = "copied";
    } catch { // not allowed for pages from disk in some browsers: it is selected instead
      getSelection().selectAllChildren(code);
    }
  });
}
