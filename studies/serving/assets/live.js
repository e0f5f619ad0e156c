// Asks for this page again every second while it is looked at, and shows what has changed.
"use strict";

const PERIOD = 1000; // milliseconds
let shown = document.querySelector("main").innerHTML;

async function refresh() {
  const connection = document.getElementById("connection");
  try {
    const response = await fetch(location.href, { cache: "no-cache" });
    const page = new DOMParser().parseFromString(await response.text(), "text/html");
    const main = page.querySelector("main[data-live]");
    if (response.ok && !main) {
      location.reload(); // the report has been written
      return;
    }
    connection.textContent = response.ok ? "" : "These results are not there any more.";
    if (response.ok && main.innerHTML !== shown) {
      shown = main.innerHTML;
      document.title = page.title;
      const scrolled = [...document.querySelectorAll(".scroll")].map((each) => each.scrollLeft);
      document.querySelector("main").replaceWith(document.adoptNode(main));
      document.querySelectorAll(".scroll").forEach((each, i) => (each.scrollLeft = scrolled[i] ?? 0));
    }
  } catch {
    connection.textContent = "The server has ended; this is what it showed last.";
  }
}

async function follow() {
  if (document.visibilityState === "visible") await refresh();
  setTimeout(follow, PERIOD);
}

document.addEventListener("visibilitychange", () => document.visibilityState === "visible" && refresh());
setTimeout(follow, PERIOD);
