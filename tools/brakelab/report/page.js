"use strict";
(() => {
  const LIGHT = Object.fromEntries(Object.entries(DARK).map(([light, dark]) => [dark, light]));
  const screenIsDark = matchMedia("(prefers-color-scheme: dark)");
  const printing = matchMedia("print");
  const models = () => Bokeh.documents.flatMap((page) => [...page.all_models]);

  function recolour() {
    if (printing.matches) return;
    const table = screenIsDark.matches ? DARK : LIGHT;
    document.documentElement.dataset.plots = screenIsDark.matches ? "dark" : "light";
    for (const model of models()) {
      for (const property of model) {
        const name = property.attr;
        if (!name.endsWith("color")) continue;
        const held = model[name];
        if (typeof held === "string" && held in table) model[name] = table[held];
        else if (held && typeof held.value === "string" && held.value in table) model[name] = { ...held, value: table[held.value] };
      }
    }
  }

  const rows = [...document.querySelectorAll("button[data-from]")];
  let chosen = -1;

  function show(place) {
    const range = models().find((model) => model.name === "drive-time");
    chosen = place;
    rows.forEach((row, at) => row.closest("tr").classList.toggle("chosen", at === place));
    if (place < 0) return range.reset();
    const from = Number(rows[place].dataset.from), to = Number(rows[place].dataset.to);
    const margin = Math.max(0.5, 0.08 * (to - from));
    range.setv({ start: from - margin, end: to + margin });
  }

  const step = (by) => rows.length && show(Math.min(Math.max(chosen + by, 0), rows.length - 1));
  rows.forEach((row, at) => row.addEventListener("click", () => {
    show(at);
    document.querySelector(".drive").scrollIntoView({ behavior: "smooth" });
  }));
  document.getElementById("whole")?.addEventListener("click", () => show(-1));
  document.getElementById("previous")?.addEventListener("click", () => step(-1));
  document.getElementById("next")?.addEventListener("click", () => step(1));
  screenIsDark.addEventListener("change", recolour);

  const started = setInterval(() => {
    if (Bokeh.documents.length === 0) return;
    clearInterval(started);
    recolour();
  }, 20);
})();
