// SPDX-License-Identifier: MIT
//
// What the element of player.js consists of: its style and its markup.

const RATES = [0.25, 0.5, 1, 1.5, 2]; // rates of playback that the bar offers

const icon = (id, label, paths) => `<button class="icon" id="${id}"
    title="${label}" aria-label="${label}"><svg viewBox="0 0 24 24"
    aria-hidden="true">${paths}</svg></button>`;

export const STYLE = `
:host { display: block; position: relative; aspect-ratio: 16 / 9;
    overflow: hidden; background: #000; color: #d9dcdf; color-scheme: dark;
    container-type: inline-size;
    font: 14px/1.45 system-ui, "Segoe UI", "DejaVu Sans", sans-serif;
    --accent: #e0a458; --target: 34px; }
:host(:fullscreen) { --below: env(safe-area-inset-bottom, 0px); --beside:
    max(env(safe-area-inset-left, 0px), env(safe-area-inset-right, 0px)); }
:host([background="transparent"]) { background: none; }
:host([hidden]), [hidden] { display: none !important; }
#frame { position: absolute; inset: 0; display: grid; place-items: center; }
canvas { outline: none; cursor: grab; touch-action: pan-y; user-select: none; }
:host(:fullscreen) canvas { touch-action: none; }
canvas:active { cursor: grabbing; }
canvas:focus-visible { outline: 2px solid var(--accent); outline-offset: -2px; }
#poster { position: absolute; width: 100%; height: 100%; object-fit: contain;
    pointer-events: none; }
#edge { position: absolute; inset: 0; pointer-events: none; opacity: 0;
    background: radial-gradient(transparent 40%, #000 90%); }
#told { position: absolute; max-width: 34em; margin: 0; padding: 0 24px;
    text-align: center; overflow-wrap: anywhere; }
#bar { position: absolute; inset: auto 0 0; transition: opacity 0.3s;
    padding: 16px calc(8px + var(--beside, 0px)) calc(6px + var(--below, 0px));
    background: linear-gradient(transparent, #000b); }
#row { display: flex; align-items: center; gap: 8px; }
#play { margin-right: auto; }
:host([resting]) #bar:not(:focus-within) { opacity: 0; }
:host([resting]) canvas { cursor: none; }
#line { position: relative; display: grid; }
#parts { position: absolute; inset: 0 8px; display: flex; align-items: center;
    gap: 2px; }
#parts span { height: 4px; border-radius: 2px;
    background: linear-gradient(90deg, #fff9 var(--got, 0%), #fff4 0); }
#time { position: relative; width: 100%; height: var(--target); margin: 0;
    background: none; appearance: none; cursor: pointer; }
#time::-webkit-slider-runnable-track, #time::-moz-range-track {
    background: none; }
#time::-webkit-slider-thumb { appearance: none; width: 16px; height: 16px;
    border-radius: 50%; background: var(--accent); }
#time::-moz-range-thumb { width: 16px; height: 16px; border: 0;
    border-radius: 50%; background: var(--accent); }
#clock { flex: 1; white-space: nowrap; font-variant-numeric: tabular-nums; }
select, ::slotted(select) { flex: 0 1 auto; min-width: var(--target);
    max-width: 10em; padding: 4px 9px; font: inherit;
    border: 1px solid #fff3; border-radius: 6px; background: #24272a;
    color: inherit; }
.icon { display: grid; place-items: center; flex: none; width: var(--target);
    height: var(--target); padding: 0; border: 0; border-radius: 6px;
    background: none; color: inherit; cursor: pointer; }
.icon:hover { background: #fff2; }
.icon svg { width: 20px; height: 20px; fill: currentColor; }
.icon .stroke { fill: none; stroke: currentColor; stroke-width: 2; }
.icon[aria-pressed="true"] { color: var(--accent); }
:focus-visible { outline: 2px solid var(--accent); outline-offset: 1px; }
.pauses, .playing .plays { display: none; }
.playing .pauses { display: inline; }
.waves { display: none; }
.heard .waves { display: inline; }
.heard .cross { display: none; }
@container (max-width: 640px) {
    #clock { display: none; }
    #row { gap: 4px; }
    #rate { flex: none; width: 72px; }
    select { padding: 4px; }
}
@container (max-width: 350px) { #rate { display: none; } }
@media (pointer: coarse) {
    /* Fingers need 44 pixels. Telephones enlarge a page in which a field with
       smaller letters than 16 pixels gets the focus. */
    :host { --target: 44px; }
    select, ::slotted(select) { height: var(--target); font-size: 16px; }
}
@media (prefers-reduced-motion: reduce) { #bar { transition: none; } }
`;

export const MARKUP = `<div id="frame">
  <canvas tabindex="0" role="img" part="canvas"
    aria-label="volumetric video; drag or use the arrow keys to look around">
  </canvas>
  <div id="edge"></div>
  <img id="poster" alt="" hidden>
  <p id="told" part="told" role="status"></p>
</div>
<div id="bar" part="bar" role="group" aria-label="player" hidden>
  <div id="line"><div id="parts"></div><input type="range" id="time" min="0"
    max="0" step="any" value="0" aria-label="time"></div>
  <div id="row">
    ${icon('play', 'Play (space)', `<path class="plays" d="M7 4v16l13-8z"/><path
        class="pauses" d="M6 4h4v16H6zM14 4h4v16h-4z"/>`)}
    <output id="clock">0.00 / 0.00 s</output>
    <select id="camera" title="Camera (1 to 9)" aria-label="camera"></select>
    <select id="rate" title="Speed" aria-label="speed">${RATES.map((rate) =>
        `<option value="${rate}"${rate === 1 ? ' selected' : ''}>${
            rate}&times;</option>`).join('')}</select>
    ${icon('reset', 'Back to the camera (R)',
        '<path class="stroke" d="M5 5v5h5M5.5 10a7.5 7.5 0 1 1-1 5"/>')}
    ${icon('sound', 'Sound on (M)', `<path d="M4 9h4l5-4v14l-5-4H4z"/>
      <path class="stroke waves" d="M16 9a4 4 0 0 1 0 6M18.5 6a8 8 0 0 1 0 12"/>
      <path class="stroke cross" d="M16 9.5l5 5M21 9.5l-5 5"/>`)}
    ${icon('tilt', 'Follow the device', `<path class="stroke"
        d="M8 5h8v14H8zM5 8a6 6 0 0 0 0 8M19 8a6 6 0 0 1 0 8"/>`)}
    <slot name="buttons"></slot>
    ${icon('headset', 'In a headset (V)', `<path class="stroke"
        d="M3 7h18v10h-6l-3-3-3 3H3z"/>`)}
    ${icon('full', 'Full screen (F)', `<path class="stroke"
        d="M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5"/>`)}
  </div>
</div>`;
