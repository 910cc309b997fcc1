// Shared by the pages: elements, pictures as SVG, round numbers for an axis, numbers as text.
const drawing = (() => {
  'use strict';
  const get = id => document.getElementById(id);
  const make = (parent, tag, text, name) => {
    const element = parent.appendChild(document.createElement(tag));
    if (text !== undefined) element.textContent = text;
    if (name) element.className = name;
    return element;
  };
  const svg = (parent, width, height, more = {}) =>
      draw(parent, 'svg', {viewBox: `0 0 ${width} ${height}`, height: height, ...more});
  const draw = (parent, tag, attributes, text) => {
    const element = parent.appendChild(document.createElementNS('http://www.w3.org/2000/svg', tag));
    for (const key in attributes) element.setAttribute(key, attributes[key]);
    if (text !== undefined) element.textContent = text;
    return element;
  };
  const signs = text => text.replace(/\+-/g, '\u00b1').replace(/([0-9] )(m?)Ohm/g, '$1$2\u03a9');
  /// Round numbers from low to high, about `count` of them.
  const ticks = (low, high, count) => {
    const rough = (high - low) / count, power = Math.pow(10, Math.floor(Math.log10(rough)));
    const step = [1, 2, 5, 10].map(m => m * power).find(s => s >= rough);
    const all = [];
    for (let t = Math.ceil(low / step - 1e-9) * step; t <= high + 1e-9 * step; t += step)
      all.push(Math.abs(t) < 1e-12 ? 0 : +t.toPrecision(10));
    return all;
  };
  const hint = (element, text) => draw(element, 'title', {}, text);
  const percent = f => (100 * f).toFixed(0) + ' %';
  /// Millivolts with about three digits.
  const mv = v => {
    if (v < 1) return v.toFixed(2) + ' mV';
    return v.toFixed(v < 100 ? 1 : 0) + ' mV';
  };
  /// Hours as h:mm or h:mm:ss.
  const clock = h => {
    const s = Math.round(h * 3600), two = n => String(n).padStart(2, '0');
    return Math.floor(s / 3600) + ':' + two(Math.floor(s / 60) % 60) + (s % 60 ? ':' + two(s % 60) : '');
  };
  return {
    get,
    make,
    draw,
    svg,
    hint,
    signs,
    ticks,
    percent,
    mv,
    clock,
    red: '#d1495b',
    blue: '#0b63b5',
    green: '#2e7d4f',
    dark: '#1c2430',
    grey: '#66707c',
    faint: '#e3e8ee'
  };
})();
