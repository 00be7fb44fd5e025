// Long tables get a line to filter their rows by, and long names in them break where words end; what
// scrolls can be scrolled by keyboard. Without scripts the pages say the same.
"use strict";

const tablesOf = (box) => box.closest("article").querySelectorAll("table");

function filterRows(box, wanted) {
  const words = wanted.toLowerCase().split(/\s+/).filter(Boolean);
  let shown = 0, all = 0;
  for (const table of tablesOf(box)) {
    let left = 0;
    for (const row of table.tBodies[0].rows) {
      const text = row.textContent.toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
      left += !row.hidden;
      all += 1;
    }
    shown += left;
    const section = table.closest("section");
    if (section.querySelectorAll("table").length === 1 && !section.contains(box)) {
      section.hidden = left === 0;
    }
  }
  return words.length ? `${shown} of ${all} ${box.dataset.what}` : `${all} ${box.dataset.what}`;
}

function addFilter(box) {
  const label = document.createElement("label");
  const input = document.createElement("input");
  const count = document.createElement("span");
  input.type = "search";
  input.placeholder = "FRM-3, server, closes …";
  count.setAttribute("role", "status");
  label.append("Show only rows with these words: ", count, input);
  box.append(label);
  const update = () => { count.textContent = filterRows(box, input.value); };
  input.addEventListener("input", update);
  update();
}

function markTarget() {
  document.querySelector(".row-target")?.classList.remove("row-target");
  const place = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const row = place?.closest("tr");
  row?.classList.add("row-target");
  row?.scrollIntoView({ block: "center", behavior: "instant" });
}

function letNamesBreak(code) {
  const text = code.textContent.split(/(?<=_)/);
  code.replaceChildren(...text.flatMap((part) => [part, document.createElement("wbr")]));
}

document.querySelectorAll("td code").forEach(letNamesBreak);
document.querySelectorAll(".row-filter").forEach(addFilter);
for (const box of document.querySelectorAll(".highlight > pre, .table-wrapper")) box.tabIndex = 0;
for (const caption of document.querySelectorAll(".caption[role=heading]")) caption.ariaLevel = 2;
addEventListener("hashchange", markTarget);
markTarget();
