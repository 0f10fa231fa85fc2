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
// A picture fits the page; a click shows it as it is, and another one as it was.
for (const link of document.querySelectorAll(".enlarge")) {
  const image = link.firstElementChild;
  const [width, height] = [image.getAttribute("width"), image.getAttribute("height")];
  let full = false;
  const layout = () => {
    const zoom = Math.max(1, Math.round(pixels.ratio()));
    image.style.width = full ? pixels.css(width, zoom) : "";
    image.style.height = full ? pixels.css(height, zoom) : "";
    link.classList.toggle("full", full);
    link.title = full ? "Fit the page" : "Full size";
  };
  link.addEventListener("click", (event) => {
    if (event.ctrlKey || event.metaKey || event.shiftKey) return; // another tab gets the file
    event.preventDefault();
    full = !full;
    layout();
  });
  layouts.push(layout);
}
// A figure is unfolded by a click or by its address, and then has its own width: who comes from another page sees its claims.
{
  document.addEventListener("toggle", ({ target }) => {
    if (!target.open || !target.parentElement.matches(".figure")) return;
    history.replaceState(null, "", `#${target.parentElement.id}`);
    for (const layout of layouts) layout();
  }, true);
  const unfold = () => {
    const figure = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (const part of figure?.querySelectorAll(":scope > details, .claims") ?? []) part.open = true;
    figure?.scrollIntoView();
  };
  addEventListener("hashchange", unfold);
  unfold();
}
