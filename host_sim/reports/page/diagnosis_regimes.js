// The errors of a diagnosis over one axis: state of charge, current, temperature, time since a step of the current.
const regimes = (() => {
  'use strict';
  const {make, draw, svg, hint, percent, mv, ticks, red, blue, grey} = drawing;
  const sand = drawing.colour('sand'), high = 104, left = 30, top = 34, bottom = top + high;

  /// Marks the range with most of the mismatch.
  const mark_found = (s, found, x) => {
    const text = ' in ' + percent(found.usual) + ' of the time';
    const area = {x: x(found.from), y: top, width: Math.max(2, x(found.to) - x(found.from)), height: high, fill: sand};
    hint(draw(s, 'rect', area), percent(found.share) + ' of the mismatch' + text);
    draw(s, 'text', {x: left, y: 27}, 'shaded: ' + percent(found.share) + ' of it' + text);
  };

  /// Bars of both models; the more time, the more solid.
  const error_bars = (s, axis, y, wide) => {
    const longest = Math.max(...axis.time);
    axis.before_mv.forEach((v, k) => {
      if (v === null) return;
      const style = {x: left + k * wide + 0.5, width: wide - 1};
      style['fill-opacity'] = 0.25 + 0.75 * Math.sqrt(axis.time[k] / longest);
      const bar = (value, fill) =>
          draw(s, 'rect', Object.assign({y: y(value), height: bottom - y(value), fill: fill}, style));
      hint(bar(v, red), mv(v) + ', ' + (100 * axis.time[k]).toFixed(1) + ' % of the time');
      if (axis.after_mv[k] !== null) bar(axis.after_mv[k], blue);
    });
  };

  const marks_of = axis => {
    if (!axis.logarithmic) return ticks(axis.low, axis.high, 5);
    return [1, 10, 100, 1000, 10000].filter(t => Math.log10(t) >= axis.low && Math.log10(t) <= axis.high);
  };

  const draw_axis = (box, axis) => {
    const width = Math.max(220, box.clientWidth), s = svg(box, width, bottom + 30), room = width - left - 4;
    const most = Math.max(1, ...axis.before_mv.concat(axis.after_mv).filter(Number.isFinite));
    const x = v => left + room * (v - axis.low) / (axis.high - axis.low), y = v => bottom - high * v / most;
    draw(s, 'text', {x: 0, y: 11, class: 'strong'}, axis.title + ', ' + axis.unit);
    if (axis.found) mark_found(s, axis.found, x);
    error_bars(s, axis, y, room / axis.before_mv.length);
    draw(s, 'line', {x1: left, x2: width - 4, y1: bottom, y2: bottom, stroke: grey});
    for (const t of ticks(0, most, 3)) draw(s, 'text', {x: left - 4, y: y(t) + 4, class: 'end'}, t);
    for (const t of marks_of(axis))
      draw(s, 'text', {x: x(axis.logarithmic ? Math.log10(t) : t), y: bottom + 14, class: 'middle'}, t);
    draw(s, 'text', {x: 0, y: top + 10}, 'mV');
  };

  const draw_regimes = row => {
    row.textContent = '';
    const boxes = report.regimes.map(() => make(row, 'div'));  // all boxes first, because they share the width
    report.regimes.forEach((axis, k) => draw_axis(boxes[k], axis));
  };
  return draw_regimes;
})();
