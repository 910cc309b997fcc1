// Which causes these recordings can distinguish: a square per pair.
const isolability = (() => {
  'use strict';
  const {make, draw, svg, hint, blue, faint} = drawing;
  const each = 18, left = 420;

  const letter = k => String.fromCharCode(65 + k);

  const draw_pair = (s, names, a, b, by, means) => {
    const x = left + b * each, y = a * each;
    const apart = by === -1;
    const box = draw(s, 'rect', {x: x + 1, y: y + 1, width: each - 2, height: each - 2, fill: apart ? blue : faint});
    if (by !== null && !apart) draw(s, 'text', {x: x + each / 2, y: y + 13, class: 'middle'}, letter(by));
    const how = apart ? 'these recordings distinguish them' :
        by === null   ? 'nothing that was tried distinguishes them' :
                        'needs ' + means[by];
    hint(box, (a + 1) + ' ' + names[a] + ' / ' + (b + 1) + ' ' + names[b] + ': ' + how);
  };

  return (figure, box) => {
    const content = report.isolability;
    figure.hidden = !content;
    box.textContent = '';
    if (!content) return;
    const {names, pairs, means} = content, count = names.length;
    make(
        box, 'p',
        'Each cause at twice its detection limit. Blue: these recordings distinguish the two. A letter: ' +
            'what would. Empty: nothing that was tried.',
        'why');
    const s = svg(make(box, 'div'), left + count * each, count * each, {preserveAspectRatio: 'xMinYMin'});
    names.forEach((name, a) => {
      const y = a * each + 13;
      draw(s, 'text', {x: 0, y: y}, (a + 1) + '  ' + name[0].toUpperCase() + name.slice(1));
      pairs[a].forEach((by, b) => draw_pair(s, names, a, b, by, means));
      draw(s, 'text', {x: left + a * each + each / 2, y: y, class: 'middle strong'}, a + 1);
    });
    const list = make(box, 'ul', undefined, 'reasons');
    means.forEach((text, k) => {
      const item = make(list, 'li');
      make(item, 'b', letter(k) + ': ');
      item.appendChild(document.createTextNode(text));
    });
  };
})();
