// What changes accounts wants the own password again where it was not shown lately: whoever finds a
// computer that somebody has left cannot change them.

import { byId, element } from '../dom.js';
import { send, sentenceFor, session } from '../session.js';

/** As send; asks for the own password where the zone wants it, and sends again. */
export async function sendConfirmed(method, path, body) {
  for (;;) {
    const answer = await send(method, path, body);
    if (answer.told.confirm !== true || !await askOwnPassword()) return answer;
  }
}

/** Whether the zone has accepted the password; not where the question was closed. */
function askOwnPassword() {
  const id = 'own-password';
  const input = element('input', { id: `${id}-input`, type: 'password', maxlength: '256', required: '',
    autocomplete: 'current-password' });
  const cancel = element('button', { id: `${id}-cancel`, class: 'decide', type: 'button' }, 'Cancel');
  const form = element('form', {}, element('h2', { id: `${id}-title` }, 'Your own password'),
    element('p', { class: 'decision-note' }, 'To change accounts, enter your password again.'),
    element('p', {}, element('label', { for: `${id}-input` }, `Password of ${session.name}`), input),
    element('p', { id: `${id}-error`, class: 'decision-error', role: 'alert' }),
    element('div', { class: 'decisions' }, cancel,
      element('button', { id: `${id}-submit`, class: 'decide decide-main', type: 'submit' }, 'Go on')));
  const dialog = element('dialog', { id, class: 'decision', 'aria-labelledby': `${id}-title` }, form);
  document.body.append(dialog);
  dialog.showModal();
  input.focus();
  return new Promise((resolve) => {
    let confirmed = false;
    // Nothing of a password stays in the page.
    dialog.addEventListener('close', () => {
      dialog.remove();
      resolve(confirmed);
    });
    cancel.addEventListener('click', () => dialog.close());
    form.addEventListener('submit', async (event) => {
      event.preventDefault();
      byId(`${id}-submit`).disabled = true;
      const answer = await send('POST', '/api/v1/session/confirm', { password: input.value });
      confirmed = answer.status === 200;
      if (confirmed) dialog.close();
      if (confirmed || !dialog.open) return;
      byId(`${id}-error`).textContent = sentenceFor(answer);
      byId(`${id}-submit`).disabled = false;
      input.value = '';
      input.focus();
    });
  });
}
