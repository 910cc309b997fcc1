// The law on which an unknown cause acts, and the curve that was learned for it.
const learned_law = (() => {
  'use strict';
  const {make, draw, svg, mv, ticks, blue, grey, faint} = drawing;
  const left = 44, top = 18, high = 120, bottom = top + high;

  const sentence = law => {
    const depends = law.depends_on.length ? ' It depends on: ' + law.depends_on.join(', ') + '.' : '';
    const text = 'The difference acts on ' + law.name + '.' + depends;
    if (!law.after_mv) return text + ' No curve can be learned for it.';
    const errors = mv(law.before_mv) + ' to ' + mv(law.after_mv);
    if (law.claim)
      return text + ' The term that was learned: ' + law.claim +
          '. With it the error on parts that were left out goes from ' + errors + '.';
    if (!law.curve.length)
      return text + ' A curve was not accepted: the error on parts that were left out goes from ' + errors +
          ', but not in all of them.';
    return text + ' With the curve below, the error on parts that were left out goes from ' + errors + '.';
  };

  const draw_curve = (box, law) => {
    const width = Math.max(240, box.clientWidth), s = svg(box, width, bottom + 30), room = width - left - 8;
    const socs = law.curve.map(p => p[0]), values = law.curve.map(p => p[1]);
    const low = Math.min(0, ...values), most = Math.max(0, ...values), range = Math.max(most - low, 1e-6);
    const x = v => left + room * (v - socs[0]) / (socs[socs.length - 1] - socs[0]);
    const y = v => bottom - high * (v - low) / range;
    draw(s, 'text', {x: 0, y: 11, class: 'strong'}, law.title + ', ' + law.unit);
    for (const t of ticks(low, most, 3)) {
      draw(s, 'line', {x1: left, x2: width - 8, y1: y(t), y2: y(t), stroke: t === 0 ? grey : faint});
      draw(s, 'text', {x: left - 4, y: y(t) + 4, class: 'end'}, t);
    }
    for (const t of ticks(socs[0], socs[socs.length - 1], 5))
      draw(s, 'text', {x: x(t), y: bottom + 14, class: 'middle'}, t + ' %');
    const points = law.curve.map(p => x(p[0]).toFixed(1) + ',' + y(p[1]).toFixed(1)).join(' ');
    draw(s, 'polyline', {points: points, fill: 'none', stroke: blue, 'stroke-width': 2});
  };

  return (figure, box) => {
    const law = report.law;
    figure.hidden = !law;
    box.textContent = '';
    if (!law) return;
    make(box, 'p', sentence(law));
    if (law.curve.length) draw_curve(make(box, 'div'), law);
  };
})();
