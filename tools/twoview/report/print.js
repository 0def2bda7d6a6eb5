// Opens what is folded while the page is printed or saved as PDF, since paper cannot be unfolded.
(function () {
  "use strict";
  let folded = [];
  window.addEventListener("beforeprint", function () {
    folded = [...document.querySelectorAll("details:not([open])")];
    for (const part of folded) part.open = true;
  });
  window.addEventListener("afterprint", function () {
    for (const part of folded) part.open = false;
  });
})();
