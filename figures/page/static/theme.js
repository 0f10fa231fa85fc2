// Colours: as the system has them, until the button chooses.
{
  const button = document.getElementById("theme");
  const system = matchMedia("(prefers-color-scheme: dark)");
  const stored = () => { try { return localStorage.getItem("theme"); } catch { return null; } };
  let choice = ["light", "dark"].includes(stored()) ? stored() : "auto";
  const apply = () => {
    document.documentElement.dataset.theme = choice === "auto" ? (system.matches ? "dark" : "light") : choice;
    button.textContent = choice;
    button.setAttribute("aria-label", `Colours: ${choice}`);
  };
  button.addEventListener("click", () => {
    choice = { auto: "light", light: "dark", dark: "auto" }[choice];
    try { localStorage.setItem("theme", choice); } catch { /* pages from disk may have no storage */ }
    apply();
  });
  system.addEventListener("change", apply);
  apply();
}
