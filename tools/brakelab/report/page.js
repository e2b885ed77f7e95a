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
  // Legends on as many lines as their names need, and the width that print scales the plots from.
  const pen = document.createElement("canvas").getContext("2d");
  function fit() {
    const drawn = document.querySelector(".plots figure")?.clientWidth;
    if (!drawn || printing.matches) return;
    const paper = drawn < 460 ? 340 : 690;
    document.documentElement.style.setProperty("--drawn", `${drawn}px`);
    document.documentElement.style.setProperty("--zoom", `${paper / drawn}`);
    for (const plot of models().filter((model) => model.type === "Figure" || model.type === "Plot")) {
      const free = drawn - 84 - (plot.right.some((axis) => axis.type === "LinearAxis") ? 58 : 0);
      for (const legend of plot.above.filter((model) => model.type === "Legend")) {
        pen.font = `${legend.label_text_font_size} ${legend.label_text_font}`;
        const widths = legend.items.map((item) => legend.glyph_width + 7 + pen.measureText(item.label.value).width);
        const row = widths.reduce((sum, width) => sum + width + legend.spacing, 0);
        const columns = Math.max(1, Math.floor(free / (Math.max(...widths) + legend.spacing)));
        const wanted = row <= free ? "auto" : columns;
        if (legend.ncols === wanted) continue;
        const lines = (count) => (count === "auto" ? 1 : Math.ceil(widths.length / count));
        plot.height += 19 * (lines(wanted) - lines(legend.ncols));
        legend.ncols = wanted;
        const figure = document.querySelector(`[data-root-id="${plot.id}"]`)?.closest("figure");
        figure?.style.setProperty("--height", `${plot.height}px`);
      }
    }
  }

  let waiting = 0;
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(fit, 100);
  });
  screenIsDark.addEventListener("change", recolour);

  // Bokeh would draw every figure before the page answers: here those near the reader are drawn first, then the others, one by one.
  const drawAll = Bokeh.embed.embed_items;
  Bokeh.embed.embed_items = (text, items) => {
    let Document, ViewManager, unescape;
    try {
      [Document, ViewManager, unescape] = [["document", "Document"], ["core/view_manager", "ViewManager"], ["core/util/string", "unescape"]]
        .map(([module, name]) => Bokeh.require(module)[name]);
    } catch { // another version's
      return drawAll(text, items).then(() => (recolour(), fit()));
    }
    const [{ roots }] = items;
    const page = Document.from_json(Object.values(JSON.parse(unescape(text)))[0]);
    recolour();
    fit();
    const views = page.views_manager = new ViewManager([], Bokeh.index);
    const waiting = new Map(Object.entries(roots).map(([model, id]) => [document.getElementById(id).closest("figure"), model]));
    let drawn = Promise.resolve();
    const draw = (figure) => {
      const model = page.get_model_by_id(waiting.get(figure));
      waiting.delete(figure);
      near.unobserve(figure);
      drawn = drawn.then(async () => {
        const view = await views.build_view(model);
        view.build(figure.firstElementChild);
        Bokeh.index.add(view);
      });
    };
    const near = new IntersectionObserver((seen) => seen.filter((one) => one.isIntersecting).forEach((one) => draw(one.target)), { rootMargin: "25%" });
    waiting.forEach((_, figure) => near.observe(figure));
    const drawOthers = () => drawn.then(() => setTimeout(() => {
      const [figure] = waiting.keys();
      if (!figure) return;
      draw(figure);
      drawOthers();
    }, 20));
    drawOthers();
    addEventListener("beforeprint", () => [...waiting.keys()].forEach(draw));
  };
})();
