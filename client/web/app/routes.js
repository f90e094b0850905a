// Every page: its address, the roles that may see it (lib/roles.js), and its section.
import { AccountPage } from './pages/people/account.js';
import { AssignmentsPage } from './pages/assignments.js';
import { AuditPage } from './pages/audit.js';
import { CourseEditor } from './pages/course_editor.js';
import { CoursesPage } from './pages/courses.js';
import { ExportsPage } from './pages/exports.js';
import { GroupPage, GroupsPage } from './pages/people/groups.js';
import { Home } from './pages/home.js';
import { LivePage } from './pages/live.js';
import { MinePage } from './pages/mine.js';
import { PeoplePage } from './pages/people/people.js';
import { PeopleImportPage } from './pages/people/people_import.js';
import { PersonPage } from './pages/people/person.js';
import { ProfileEditor } from './pages/profile_editor.js';
import { ProfilesPage } from './pages/profiles.js';
import { ProgressPage } from './pages/progress.js';
import { ReferencePage } from './pages/reference.js';
import { ResultsPage } from './pages/results.js';
import { RetentionPage } from './pages/retention.js';
import { CourseRevisions, ProfileRevisions } from './pages/revisions.js';
import { SessionPage } from './pages/session.js';
import { SessionsPage } from './pages/sessions.js';
import { TodayPage } from './pages/today.js';
import { UnknownTraineesPage } from './pages/people/unknown_trainees.js';
import { UpkeepPage } from './pages/upkeep.js';

export const kRoutes = [
  { path: '/', page: Home, section: 'Home' },
  { path: '/today/:list', page: TodayPage, action: 'see results', section: 'Home' },
  { path: '/account', page: AccountPage, action: 'own account' },
  { path: '/people', page: PeoplePage, action: 'see people', section: 'People' },
  { path: '/people/import', page: PeopleImportPage, action: 'edit people', section: 'People' },
  { path: '/people/:name', page: PersonPage, action: 'see people', section: 'People' },
  { path: '/groups', page: GroupsPage, action: 'see people', section: 'Groups' },
  { path: '/groups/:id', page: GroupPage, action: 'see people', section: 'Groups' },
  { path: '/profiles', page: ProfilesPage, action: 'see profiles', section: 'Profiles' },
  { path: '/profiles-new', page: ProfileEditor, action: 'edit profiles', section: 'Profiles' },
  { path: '/profiles/:id', page: ProfileEditor, action: 'see profiles', section: 'Profiles' },
  { path: '/profiles/:id/revisions', page: ProfileRevisions, action: 'see profiles', section: 'Profiles' },
  { path: '/courses', page: CoursesPage, action: 'see courses', section: 'Courses' },
  { path: '/courses-new', page: CourseEditor, action: 'edit courses', section: 'Courses' },
  { path: '/courses/:id', page: CourseEditor, action: 'see courses', section: 'Courses' },
  { path: '/courses/:id/revisions', page: CourseRevisions, action: 'see courses', section: 'Courses' },
  { path: '/assignments', page: AssignmentsPage, action: 'assign', section: 'Assignments' },
  { path: '/mine', page: MinePage, action: 'see own', section: 'My results' },
  { path: '/results', page: ResultsPage, action: 'see results', section: 'Results' },
  { path: '/progress/:name', page: ProgressPage, action: 'see sessions', section: 'Results' },
  { path: '/references/:exercise', page: ReferencePage, action: 'set reference', section: 'Results' },
  { path: '/live', page: LivePage, action: 'see live', section: 'Live lab' },
  { path: '/sessions/:id', page: SessionPage, action: 'see sessions', section: 'Sessions' },
  { path: '/sessions', page: SessionsPage, action: 'see sessions', section: 'Sessions' },
  { path: '/unknown-trainees', page: UnknownTraineesPage, action: 'assign sessions', section: 'Sessions' },
  { path: '/exports', page: ExportsPage, action: 'export', section: 'Exports' },
  { path: '/audit', page: AuditPage, action: 'see audit', section: 'Audit' },
  { path: '/retention', page: RetentionPage, action: 'retention', section: 'Retention' },
  { path: '/upkeep', page: UpkeepPage, action: 'upkeep', section: 'Upkeep' },
];
