// Starts the page: its other scripts and that of the worker are compressed; their sources are the files page/script/*.js of sdmgen.
'use strict';
const $ = id => document.getElementById(id);

// The bytes of an element with a base64 text.
function bytesOf(id) {
  return Uint8Array.from(atob($(id).textContent.trim()), c => c.charCodeAt(0));
}

async function unzip(id) {
  $(id).textContent = await new Response(new Blob([bytesOf(id)]).stream().pipeThrough(new DecompressionStream('gzip'))).text();
}

Promise.all([unzip('worker'), unzip('scripts')]).then(() => {
  document.body.append(Object.assign(document.createElement('script'), { textContent: $('scripts').textContent }));
}, error => {
  $('notice').textContent = 'This browser is too old for this page: ' + error.message;
  $('notice').hidden = false;
});
