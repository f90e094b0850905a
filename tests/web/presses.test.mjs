// A dialog's events while the page stands still, by the times at which they were pressed.
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { dialogGate, digitOnTheKey, oneAtATime } from '../../client/web/app/lib/presses.js';

/** What a dialog that is painted at 1000 ms takes of `[type, ms, repeat]`, in their order; all are heard after it. */
function taken(...events) {
  const gate = dialogGate();
  gate.painted(1000);
  return events.map(([type, timeStamp, repeat = false]) => gate.takes({ type, timeStamp, repeat }));
}

test('nothing is taken before the dialog is painted', () => {
  const gate = dialogGate();
  for (const type of ['keydown', 'pointerdown', 'mousedown', 'click', 'cancel'])
    assert.equal(gate.takes({ type, timeStamp: 1e12 }), false, type);
});

test('what was pressed before the dialog was painted is not for it, however late it is heard of', () => {
  assert.deepEqual(taken(['keydown', 999], ['click', 999]), [false, false], 'Enter on the button that has the focus');
  assert.deepEqual(
    taken(['keydown', 999], ['cancel', 1005]),
    [false, false],
    'Escape: the browser makes its cancel later',
  );
  assert.deepEqual(taken(['keydown', 1000], ['click', 1000]), [true, true]);
  assert.deepEqual(taken(['keydown', 1000], ['cancel', 1001]), [true, true]);
});

test('a click counts with the press that began it', () => {
  const press = (down_ms, up_ms) => taken(['pointerdown', down_ms], ['mousedown', down_ms], ['click', up_ms]);
  assert.deepEqual(press(990, 1080), [false, false, false], 'down before the dialog was there');
  assert.deepEqual(press(1100, 1180), [true, true, true]);
  assert.deepEqual(
    taken(['pointerdown', 990], ['click', 1080], ['pointerdown', 1200], ['click', 1280]),
    [false, false, true, true],
    'the next one is meant for the dialog',
  );
  assert.deepEqual(taken(['click', 1100]), [true], 'of a program that helps a person: without a press');
});

test('a key that is held since before does nothing until it is pressed again', () => {
  assert.deepEqual(
    taken(
      ['keydown', 600],
      ['keydown', 1100, true],
      ['click', 1100],
      ['keydown', 1140, true],
      ['keydown', 2000],
      ['click', 2000],
      ['keydown', 2500, true],
    ),
    [false, false, false, false, true, true, true],
  );
  assert.deepEqual(taken(['keydown', 1100, true]), [false], 'its first press opened the dialog');
});

test('a form is sent once, and again after it was refused', async () => {
  const once = oneAtATime();
  const sent = [];
  let answer;
  const send = (what) =>
    once(() => {
      sent.push(what);
      return new Promise((resolve, reject) => (answer = { resolve, reject }));
    });
  const first = send('a');
  assert.equal(await send('a'), undefined, 'a second Enter before the first is drawn');
  answer.resolve('stored');
  assert.equal(await first, 'stored');
  const refused = send('b');
  answer.reject(new Error('refused'));
  await assert.rejects(refused, /refused/);
  const next = send('c');
  answer.resolve('stored');
  assert.equal(await next, 'stored');
  assert.deepEqual(sent, ['a', 'b', 'c']);
});

test('a badge reader types digits on a French keyboard too', () => {
  // what a reader's 471221 is on AZERTY: the digits are on the keys, and the signs are typed without Shift
  let code = '';
  let stopped = 0;
  const press = (key, event = {}) => {
    const target = { value: code, selectionStart: code.length, selectionEnd: code.length };
    const typed = { key, target, preventDefault: () => (stopped += 1), ...event };
    digitOnTheKey((text) => (code = text))(typed);
  };
  [
    ["'", 4],
    ['è', 7],
    ['&', 1],
    ['é', 2],
    ['é', 2],
    ['&', 1],
  ].forEach(([key, n]) => press(key, { code: `Digit${n}` }));
  assert.equal(code, '471221');
  assert.equal(stopped, 6, 'the signs are not typed');
  press('1', { code: 'Digit1' });
  press('&', { code: 'Digit1', shiftKey: true });
  press('q', { code: 'KeyA' });
  assert.deepEqual([code, stopped], ['471221', 6], 'the field itself takes these');
});
