// Claims of a figure, how it was made, and its numbers as a folding tree: in a script that is read when first unfolded.
for (const box of document.querySelectorAll(".claims, .numbers")) {
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
  const show = () => {
    loading.remove();
    const { claims, facts, note, numbers } = window.figureNumbers[box.closest("article").id];
    if (box.matches(".claims")) {
      box.append(element("div", { innerHTML: claims }));
      return;
    }
    box.append(element("p", { className: "note" }, note),
      element("dl", { className: "facts" }, ...Object.entries(facts).map(([name, value]) =>
        element("div", {}, element("dt", {}, name), element("dd", {}, value)))),
      element("div", { className: "tree" }, ...Object.entries(numbers).map(([key, value]) => node(key, value))));
  };
  const loading = element("p", { className: "note", role: "status" }, "Loading …");
  const failed = () => { loading.textContent = "page-numbers.js cannot be read."; };
  box.addEventListener("toggle", () => {
    box.append(loading);
    if (window.figureNumbers) show();
    else document.head.append(element("script", { src: "page-numbers.js", onload: show, onerror: failed }));
  }, { once: true });
}
