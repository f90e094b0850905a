// What structures are: what follows from each kind. Made by profile_test from the rows in
// common/profile/structure_kinds.cpp; not to be edited (tests/unit/common/profile/structure_kinds_test.cpp).
// prettier-ignore
export const kKinds = [
  { name: 'SKIN', words: 'skin', tissue: 'SKIN', hazard: 'OTHER', color: '#e8b48c' },
  { name: 'FAT', words: 'fat', tissue: 'FAT', hazard: 'OTHER', color: '#f3dc7e' },
  { name: 'MUSCLE', words: 'muscle', tissue: 'MUSCLE', hazard: 'OTHER', color: '#b4503c' },
  { name: 'FASCIA', words: 'fascia', tissue: 'OTHER', hazard: 'OTHER', color: '#d8cfc0' },
  { name: 'LIGAMENT', words: 'ligament', tissue: 'TENDON', hazard: 'OTHER', color: '#ddd2b4' },
  { name: 'TENDON', words: 'tendon', tissue: 'TENDON', hazard: 'OTHER', color: '#eae3cf' },
  { name: 'CARTILAGE', words: 'cartilage', tissue: 'CARTILAGE', hazard: 'OTHER', color: '#7fb5a8' },
  { name: 'BONE', words: 'bone', tissue: 'BONE', hazard: 'BONE', color: '#f7f1e1' },
  { name: 'NERVE', words: 'nerve', tissue: 'OTHER', hazard: 'NERVE', color: '#f2dc3c' },
  { name: 'ARTERY', words: 'artery', tissue: 'OTHER', hazard: 'VESSEL', color: '#d0392b' },
  { name: 'VEIN', words: 'vein', tissue: 'OTHER', hazard: 'VESSEL', color: '#5a79cf' },
  { name: 'BURSA', words: 'bursa', tissue: 'BURSA', hazard: 'OTHER', color: '#8ccbea' },
  { name: 'FLUID', words: 'fluid', tissue: 'OTHER', hazard: 'OTHER', color: '#a9d3ea' },
  { name: 'DURA', words: 'dura', tissue: 'OTHER', hazard: 'NERVE', color: '#c9b7ce' },
  { name: 'CAPSULE', words: 'joint capsule', tissue: 'CAPSULE', hazard: 'OTHER', color: '#c08fb4' },
  { name: 'DISC', words: 'disc', tissue: 'CARTILAGE', hazard: 'OTHER', color: '#b9cbb4' },
  { name: 'SYNOVIUM', words: 'synovium', tissue: 'OTHER', hazard: 'OTHER', color: '#d9a9a0' },
  { name: 'OTHER', words: 'other', tissue: 'OTHER', hazard: 'OTHER', color: '#8a93a6' },
];
/** The colours of a body's muscles, in turn. */
export const kMuscleColors = ['#b4503c', '#86302f', '#cb7a66', '#9c3a48', '#c76a42'];
