// The page begins. Where one of its files did not come, all are asked for again: nobody has signed
// in yet, so nothing is lost.

const kPause_ms = 1000;

import("/page/main.js").catch((error) => {
  document.getElementById("fleet-summary").textContent =
      `The page did not come whole, and is loaded again: ${error.message}`;
  setTimeout(() => window.location.reload(), kPause_ms);
});
