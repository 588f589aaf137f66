"use strict";
/* Columns of tables are wide enough for a few words; a table that is then too wide scrolls. */
addEventListener("DOMContentLoaded", () => {
  const enough = 10 * parseFloat(getComputedStyle(document.documentElement).fontSize);
  for (const table of document.querySelectorAll("article .table-wrapper table")) {
    table.style.whiteSpace = "nowrap";
    const widths = [...table.rows[0].cells].map((cell) => cell.offsetWidth);
    table.style.whiteSpace = "";
    widths.forEach((width, k) => { table.rows[0].cells[k].style.minWidth = `${Math.min(width, enough)}px`; });
  }
});
/* What scrolls can be reached with the keyboard. */
addEventListener("DOMContentLoaded", () => {
  for (const part of document.querySelectorAll("article pre, article .table-wrapper, article .cell-output, article p:has(> img)")) {
    if (part.scrollWidth > part.clientWidth) part.tabIndex = 0;
  }
});
/* Each block of code has a button that copies it. */
addEventListener("DOMContentLoaded", () => {
  for (const block of document.querySelectorAll("article div.highlight")) {
    const button = document.createElement("button");
    button.className = "copy";
    button.type = "button";
    button.textContent = "Copy";
    button.addEventListener("click", async () => {
      await navigator.clipboard.writeText(block.querySelector("pre").textContent.trimEnd());
      button.textContent = "Copied";
      setTimeout(() => { button.textContent = "Copy"; }, 2000);
    });
    block.append(button);
  }
});
