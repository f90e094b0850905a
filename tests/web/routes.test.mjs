import assert from 'node:assert/strict';
import { test } from 'node:test';
import { grantable, kRoles, may, roleName } from '../../client/web/app/lib/roles.js';
import { href, match } from '../../client/web/app/lib/routes.js';

const kTable = [
  { path: '/' },
  { path: '/people' },
  { path: '/people/import' },
  { path: '/people/:name' },
  { path: '/profiles/:id/revisions' },
];

test('addresses lead to pages; the first that fits is taken', () => {
  const found = (hash) => match(kTable, hash).route?.path ?? null;
  for (const [hash, path] of [
    ['', '/'],
    ['#', '/'],
    ['#/', '/'],
    ['#/people', '/people'],
    ['#/people/', '/people'],
    ['#/people/import', '/people/import'],
    ['#/people/anna', '/people/:name'],
    ['#/nowhere', null],
    ['#/people/a/b', null],
  ])
    assert.equal(found(hash), path, hash);
});

test('what is written into an address comes out of it again', () => {
  for (const name of ['anna', 'a b', 'a/b', 'ä?&=#', '100%', '..']) {
    const { params, query } = match(
      kTable,
      href(['profiles', name, 'revisions'], { from: 1, to: name, gone: '', none: undefined }),
    );
    assert.equal(params.id, name);
    assert.deepEqual(query, { from: '1', to: name });
  }
});

test('a broken escape gives no page instead of an error', () => {
  assert.equal(match(kTable, '#/people/%zz').route, null);
});

test('roles: the wire and people spell them differently', () => {
  assert.equal(roleName('CURRICULUM_MANAGER'), 'curriculum-manager');
  assert.equal(roleName('curriculum-manager'), 'curriculum-manager');
});

test('who may what', () => {
  assert.ok(may('administrator', 'upkeep') && !may('curriculum-manager', 'upkeep'));
  assert.ok(may('instructor', 'annotate') && !may('curriculum-manager', 'annotate') && !may('trainee', 'annotate'));
  assert.ok(may('curriculum-manager', 'edit profiles') && !may('instructor', 'edit profiles'));
  assert.deepEqual(
    kRoles.filter((r) => may(r, 'see own')),
    ['trainee'],
  );
  assert.ok(!kRoles.filter((r) => r !== 'researcher').every((r) => may('researcher', 'see people')));
  assert.throws(() => may('trainee', 'fly'), /fly/);
});

test('nobody gives a role above their own', () => {
  assert.ok(!grantable('curriculum-manager').includes('administrator'));
  assert.deepEqual(grantable('instructor'), []);
  assert.deepEqual(grantable('administrator'), kRoles);
});
