// Bars lead to views, arrows go from one view to the next, and a button turns the page light or dark.
(() => {
  "use strict";
  const page = document.documentElement;
  page.classList.replace("no-script", "script");

  const themes = ["", "dark", "light"];
  document.getElementById("theme").addEventListener("click", () => {
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    const order = dark ? ["", "light", "dark"] : themes;
    page.dataset.theme = order[(order.indexOf(page.dataset.theme || "") + 1) % order.length];
  });

  const views = [...document.querySelectorAll("article.view")];
  if (!views.length) return;
  const order = views.map((view) => view.dataset.view);
  const choice = document.getElementById("view-choice");
  const bars = new Map(
    order.map((index) => [index, document.querySelector(`.drawing a[href="#view-${index}"]`)]).filter(([, bar]) => bar),
  );
  let current = null;

  const show = (index, scroll) => {
    if (!order.includes(index)) return;
    current = index;
    for (const view of views) view.classList.toggle("chosen", view.dataset.view === index);
    for (const [other, bar] of bars) {
      bar.classList.toggle("chosen", other === index);
      bar.setAttribute("aria-current", String(other === index));
    }
    choice.value = index;
    if (scroll) document.getElementById(`view-${index}`).scrollIntoView({ block: "nearest" });
  };
  const step = (by) => {
    const place = order.indexOf(current) + by;
    if (place >= 0 && place < order.length) show(order[place], false);
  };

  for (const view of views) {
    const bar = bars.get(view.dataset.view);
    if (!bar) continue;
    bar.classList.add("bar");
    bar.setAttribute("aria-label", `${view.querySelector("h3").textContent}, ${view.querySelector(".facts").textContent}`);
    bar.setAttribute("aria-controls", view.id);
    bar.addEventListener("click", (event) => {
      event.preventDefault();
      show(view.dataset.view, true);
    });
  }
  choice.addEventListener("change", () => show(choice.value, false));
  document.getElementById("worse").addEventListener("click", () => step(-1));
  document.getElementById("better").addEventListener("click", () => step(1));
  document.getElementById("marks").addEventListener("change", (event) => {
    page.classList.toggle("unmarked", !event.target.checked);
  });
  const named = () => {
    const found = /^#view-(\d+)$/.exec(location.hash);
    if (found) show(found[1], true);
    return Boolean(found);
  };
  addEventListener("hashchange", named);
  if (!named()) show(order[0], false);
})();
