// Sort the table of claims by a column, and show those of one verdict, a paper, or with some words: the first, then all.
{
  const FOLDED = 30;
  const table = document.getElementById("ledger-table");
  const filtered = (body) => {
    const rows = [...body.rows];
    for (const place of body.querySelectorAll("td > span[id]")) place.remove(); // The address filters instead.
    const chips = [...document.querySelectorAll(".chip")];
    const verdicts = chips.map((chip) => chip.dataset.verdict);
    const paper = document.getElementById("ledger-paper");
    const search = document.getElementById("ledger-search");
    const shown = document.getElementById("ledger-shown");
    const more = document.getElementById("ledger-more");
    let [verdict, most] = ["", FOLDED];

    const filter = () => {
      const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
      const found = rows.filter((row) => (!verdict || row.dataset.verdict === verdict)
        && (!paper.value || row.cells[0].textContent.startsWith(`${paper.selectedOptions[0].text},`))
        && words.every((word) => row.textContent.toLowerCase().includes(word)));
      for (const row of rows) row.hidden = true;
      for (const row of found.slice(0, most)) row.hidden = false;
      for (const chip of chips) chip.setAttribute("aria-current", chip.dataset.verdict === verdict);
      shown.textContent = found.length === rows.length ? `${rows.length} claims` : `${found.length} of ${rows.length} claims`;
      more.hidden = found.length <= most;
      more.textContent = `${found.length - most} more`;
    };
    more.addEventListener("click", () => { most = Infinity; filter(); });
    // The address says what is shown: ledger.html#z,differs is what differs from the Z paper.
    const read = () => {
      const asked = location.hash.slice(1).split(",");
      verdict = verdicts.find((each) => asked.includes(each)) ?? "";
      paper.value = [...paper.options].map((option) => option.value).find((each) => each && asked.includes(each)) ?? "";
      filter();
    };
    const go = (chosen) => { location.hash = [paper.value, chosen].filter(Boolean).join(",") || "all"; };
    for (const chip of chips) {
      chip.addEventListener("click", (event) => {
        event.preventDefault();
        go(chip.dataset.verdict === verdict ? "" : chip.dataset.verdict);
      });
    }
    paper.addEventListener("change", () => go(verdict));
    search.addEventListener("input", filter);
    addEventListener("hashchange", read);
    read();

    const value = (row, column) => (column === 2 ? verdicts.indexOf(row.dataset.verdict) : row.cells[column].textContent.trim());
    const compare = new Intl.Collator("en", { numeric: true }).compare;
    [...table.tHead.rows[0].cells].forEach((head, column, heads) => {
      head.firstChild.addEventListener("click", () => {
        const down = head.getAttribute("aria-sort") === "ascending";
        for (const other of heads) other.setAttribute("aria-sort", "none");
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        rows.sort((a, b) => (down ? -1 : 1) * compare(value(a, column), value(b, column)));
        body.append(...rows);
        filter();
      });
    });
  };
  if (table) filtered(table.tBodies[0]);
}
