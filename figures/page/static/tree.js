// The numbers of a figure as a folding tree, made when it is first opened.
for (const box of document.querySelectorAll(".numbers")) {
  const leaf = (key, text) => element("p", {}, element("span", { className: "key" }, key), ` ${text}`);
  const simple = (value) => value === null || typeof value !== "object";
  const node = (key, value) => {
    if (simple(value)) return leaf(key, JSON.stringify(value));
    const entries = Object.entries(value);
    if (Array.isArray(value) && value.every(simple) && value.length <= 16) return leaf(key, JSON.stringify(value));
    const made = element("details", {}, element("summary", {}, element("span", { className: "key" }, key), ` ${entries.length}`));
    made.addEventListener("toggle", () => made.append(...entries.map(([k, v]) => node(k, v))), { once: true });
    return made;
  };
  box.addEventListener("toggle", () => {
    const numbers = JSON.parse(box.querySelector("script").textContent);
    box.querySelector(".tree").append(...Object.entries(numbers).map(([key, value]) => node(key, value)));
  }, { once: true });
}
