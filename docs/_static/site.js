"use strict";
/* Columns of tables are wide enough for a few words, the widest for up to half a line; what is too wide then scrolls. */
addEventListener("DOMContentLoaded", () => {
  const enough = 8 * parseFloat(getComputedStyle(document.documentElement).fontSize);
  for (const table of document.querySelectorAll("article .table-wrapper table")) {
    table.style.whiteSpace = "nowrap";
    const widths = [...table.rows[0].cells].map((cell) => cell.offsetWidth);
    const widest = widths.indexOf(Math.max(...widths));
    const more = Math.max(enough, Math.min(2 * enough, table.parentElement.clientWidth / 2));
    table.style.whiteSpace = "";
    widths.forEach((width, k) => {
      table.rows[0].cells[k].style.minWidth = `${Math.min(width, k === widest ? more : enough)}px`;
    });
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
