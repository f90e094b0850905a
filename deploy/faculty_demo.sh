# deploy/demo --faculty: two servers on one database, one of which is killed in mid-lesson; sourced by deploy/demo.
# shellcheck shell=bash
# Needs bin, root. A primary of PostgreSQL with a synchronous standby, NATS, servers a and b, eight stations (four at each server),
# an instructor at b who watches a station at a. Nothing runs as root: if the demo does, the parts run as the user postgres.

declare -A running=()            # name: process
as=() place='' sockets='' out='' # how to become the services' user; their folder; that of PostgreSQL's sockets; the output that is kept
at_a='' at_b='' at_nats='' ca='' # where the servers and NATS listen; the lab's authority
pg=/usr/lib/postgresql/15/bin nats=''

cluster_stops() { # NAME: at once, because nothing is kept
  [ ! -f "$place/$1/postmaster.pid" ] || "${as[@]}" "$pg/pg_ctl" -D "$place/$1" -m immediate -w -t 30 stop >/dev/null 2>&1
}

# Ends everything and removes the services' folder, however the demo ends.
faculty_end() {
  local name left _
  trap '' INT TERM HUP
  for name in "${!running[@]}"; do kill -TERM "${running[$name]}" 2>/dev/null || true; done
  for _ in $(seq 40); do
    left=no
    for name in "${!running[@]}"; do ! kill -0 "${running[$name]}" 2>/dev/null || left=yes; done
    [ "$left" = yes ] || break
    sleep 0.1
  done
  for name in "${!running[@]}"; do
    kill -KILL "${running[$name]}" 2>/dev/null || true
    { wait "${running[$name]}" || true; } 2>/dev/null
  done
  if [ -n "$place" ]; then
    for name in primary standby; do cluster_stops "$name" || true; done
    cp "$place"/*.log "$place"/results/* "$out/" 2>/dev/null || true
    rm -rf "$place"
  fi
  [ -z "$sockets" ] || rm -rf "$sockets"
  running=() place='' sockets=''
}

in_vain() { # TEXT
  tail -n 4 "$out"/server-*.log >&2 || true
  die "$1; the logs are in $out"
}

# until_so SECONDS WHAT COMMAND…: waits until the command succeeds
until_so() {
  local end=$((SECONDS + $1)) what=$2
  shift 2
  until "$@"; do
    [ "$SECONDS" -lt "$end" ] || in_vain "in vain: $what"
    sleep 0.1
  done
}

quietly() { # COMMAND…: prints its output only if it fails
  local words
  words=$("$@" 2>&1 </dev/null) || { printf '%s\n' "$words" >&2; in_vain "failed: $*"; }
}

# begins NAME COMMAND…: in the background, as the services' user; says what it does in NAME.log
begins() {
  local name=$1
  shift
  "${as[@]}" "$@" >"$out/$name.log" 2>&1 </dev/null &
  running[$name]=$!
}

# ends NAME: asks it to end, and returns its exit code
ends() {
  local pid=${running[$1]} code=0
  unset "running[$1]"
  kill -TERM "$pid" 2>/dev/null || true
  wait "$pid" || code=$?
  return "$code"
}

lives() { kill -0 "${running[$1]}" 2>/dev/null; }

put() { "${as[@]}" tee "$place/$1" >/dev/null; } # FILE: from standard input

secret() { head -c 18 /dev/urandom | od -An -tx1 | tr -d ' \n'; }

# sql primary|standby TEXT: as PostgreSQL's administrator, who waits for no standby. Columns are apart by a blank
sql() {
  local port=5432
  [ "$1" = primary ] || port=5433
  "${as[@]}" PGOPTIONS='-c synchronous_commit=local' "$pg/psql" -XAtqF ' ' -h "$sockets" -p "$port" -U postgres -d "${3:-needlelab}" \
    -v ON_ERROR_STOP=1 -c "$2"
}
says() { [ "$(sql "$1" "$2" "${4:-needlelab}")" = "$3" ]; } # primary|standby SQL ANSWER [DATABASE]

# on DIR ARGUMENT…: needlelab-admin on a folder. asks WHO ARGUMENT…: the same on server b
on() {
  local folder=$1
  shift
  quietly "${as[@]}" "$bin/needlelab-admin" --data "$place/$folder" "$@"
}
asks() {
  local who=$1
  shift
  timeout --foreground 120 "${as[@]}" "$bin/needlelab-admin" --server "$at_b" --ca "$ca" --user "$who" --password-file "$place/$who.password" "$@"
}

faculty_place() {
  local user=''
  [ "$(id -u)" -ne 0 ] || user=postgres
  # shellcheck disable=SC2154 # deploy/lib.sh has it
  mkdir -p "$root/out/demo"
  umask 077
  out=$root/out/demo/faculty-$(date +%Y%m%d-%H%M%S)-$$
  mkdir "$out"
  # others may pass through it, and read nothing
  chmod 711 "$out"
  ln -sfn "$(basename "$out")" "$root/out/demo/faculty"
  place=$out/services
  mkdir "$place"
  as=(env HOME="$place/home")
  if [ -n "$user" ]; then
    chown "$user": "$place"
    as=(setpriv --reuid "$user" --regid "$user" --clear-groups env HOME="$place/home")
    # a checkout below /root is closed to others
    if ! "${as[@]}" test -w "$place"; then
      rmdir "$place"
      place=$(mktemp -d /tmp/needlelab-faculty-XXXXXX)
      chown "$user": "$place"
      as=("${as[@]:0:${#as[@]}-1}" HOME="$place/home")
    fi
  fi
  # a socket's path has at most 107 bytes
  sockets=$(mktemp -d /tmp/needlelab-sockets-XXXXXX)
  [ -z "$user" ] || chown "$user": "$sockets"
  # does not enter a folder that is closed to the services' user
  cd /
  "${as[@]}" mkdir "$place/home" "$place/results"
  if ! "${as[@]}" test -x "$bin/needlelab-server"; then
    mkdir "$place/bin"
    install -m 755 "$bin"/needlelab-{server,admin,station,instructor} "$place/bin"
    chmod 755 "$place/bin"
    bin=$place/bin
  fi
}

# PostgreSQL: two clusters as on two machines. A COMMIT is answered when both have it on disk; data made before the first one need not be.
faculty_database() {
  quietly "${as[@]}" "$pg/initdb" -D "$place/primary" -U postgres -A trust -E UTF8 --locale=C --data-checksums --no-sync
  # the clusters' folders belong to the services' user, who alone reaches the sockets. The end of the demo asks when a row was committed
  "${as[@]}" tee -a "$place/primary/postgresql.conf" >/dev/null <<TEXT
listen_addresses = ''
unix_socket_directories = '$sockets'
unix_socket_permissions = 0700
port = 5432
max_connections = 120
shared_buffers = '64MB'
log_error_verbosity = terse
track_commit_timestamp = on
TEXT
  quietly "${as[@]}" "$pg/pg_ctl" -D "$place/primary" -l "$place/primary.log" -w start
  "${as[@]}" "$pg/psql" -Xq -h "$sockets" -U postgres -d postgres -v ON_ERROR_STOP=1 -f - <"$root/deploy/faculty/database.sql" >/dev/null ||
    in_vain "deploy/faculty/database.sql was refused"
  quietly "${as[@]}" "$pg/pg_basebackup" -h "$sockets" -U postgres -D "$place/standby" -X stream --slot b --checkpoint=fast --no-sync
  "${as[@]}" tee -a "$place/standby/postgresql.conf" >/dev/null <<TEXT
port = 5433
primary_conninfo = 'host=$sockets port=5432 user=postgres application_name=b'
primary_slot_name = 'b'
TEXT
  "${as[@]}" touch "$place/standby/standby.signal"
  quietly "${as[@]}" "$pg/pg_ctl" -D "$place/standby" -l "$place/standby.log" -w start
  quietly sql primary "ALTER SYSTEM SET synchronous_standby_names = 'ANY 1 (b)'" postgres
  quietly sql primary "SELECT pg_reload_conf()" postgres
  until_so 60 "the standby is synchronous" says primary "SELECT sync_state FROM pg_stat_replication WHERE application_name = 'b'" quorum postgres
  echo "  a COMMIT waits for the standby: synchronous_standby_names = $(sql primary 'SHOW synchronous_standby_names')"
}

# NATS: core only, nothing on disk. The port is any free one.
faculty_nats() {
  local password
  password=$(secret)
  put nats.conf <<TEXT
listen: "127.0.0.1:-1"
server_name: "demo"
ports_file_dir: "$place"
authorization {
  users = [ { user: "needlelab", password: "$password", permissions: { publish: "nl.>", subscribe: "nl.>" } } ]
}
TEXT
  put nats.user <<TEXT
user = needlelab
password = $password
TEXT
  begins nats "$nats" -c "$place/nats.conf"
  local ports=$place/nats-server_${running[nats]}.ports
  until_so 60 "nats-server listens" test -s "$ports"
  at_nats=$(grep -o 'nats://[^"]*' "$ports" | head -n 1)
  [ -n "$at_nats" ] || in_vain "nats-server did not say where it listens"
}

server_begins() { # NAME
  begins "server-$1" "$bin/needlelab-server" --data "$place/$1" --together --durability two-disks --listen 127.0.0.1:0 \
    --port-file "$place/$1.port" --web off --live "$at_nats" --live-user "$place/nats.user" --live-name "$1"
  until_so 60 "server $1 listens" faculty_listens "$1"
}
faculty_listens() { # SERVER
  lives "server-$1" || in_vain "server $1 ended"
  [ -s "$place/$1.port" ]
}

# the lessons: station, trainee, exercise. The first four use server a while it lives
faculty_lessons() {
  cat <<'TABLE'
station-1 anna knee-recess
station-2 ben shoulder-bursa
station-3 chloe shoulder-bursa-muscular
station-4 david shoulder-bursa-frail
station-5 elif knee-recess
station-6 farid shoulder-bursa
station-7 greta shoulder-bursa-muscular
station-8 hugo shoulder-bursa-frail
TABLE
}
readonly watched=station-2

all_store() { # every station has a session with at least two stored chunks
  says primary "SELECT count(*) FROM needlelab.sessions s WHERE (SELECT count(*) FROM needlelab.chunks c WHERE c.session = s.number) > 1" 8
}
# the four stations of server a log in at b, and b stores data from each; by the times of PostgreSQL's commits
readonly moved="SELECT k.station, k.since_unix_ns, min(c.stored) FILTER (WHERE c.stored > to_timestamp(k.since_unix_ns / 1e9)) AS again
  FROM needlelab.station_claims k JOIN needlelab.sessions s ON s.station = k.station
    JOIN (SELECT session, pg_xact_commit_timestamp(xmin) AS stored FROM needlelab.chunks) c ON c.session = s.number
  WHERE k.server = 'b' AND k.station IN ('station-1', 'station-2', 'station-3', 'station-4') GROUP BY k.station, k.since_unix_ns"
all_moved() { says primary "SELECT count(again) FROM ($moved) AS m" 4; }

frames() { grep -c '"type":"update"' "$out/watch.log" || true; }
lost_at_b() { cat "$out"/station-[5-8].log | grep -c ' is lost (' || true; }
frames_since() { # UNIX_S [COUNT]: this many frames came after it
  awk -v since="$1" -v wanted="${2:-1}" '/"type":"update"/ && $1 > since && ++n >= wanted { found = 1; exit } END { exit !found }' "$out/watch.log"
}
field() { sed -n "s/.*\"$2\": *\"\{0,1\}\([0-9A-Za-z-]*\).*/\1/p" "$1" | head -n 1; } # FILE KEY: of a summary

picture() { # FILE WINDOW SECONDS OPTION…: of the instructor's window at server b, drawn without a display
  local file=$1 window=$2 seconds=$3
  shift 3
  timeout --foreground 60 "${as[@]}" "$bin/needlelab-instructor" --off-screen --server "$at_b" --ca "$ca" --user ines --password-file "$place/ines.password" \
    --window "$window" --screenshot "$place/results/$file" --at "$seconds" "$@" >"$out/$file.log" 2>&1 </dev/null && rm "$out/$file.log" ||
    echo "  note: no picture $file (see $out/$file.log)"
}

faculty_demo() {
  nats=$(command -v nats-server || echo /usr/sbin/nats-server)
  [ -x "$pg/initdb" ] || die "$pg/initdb is missing: install PostgreSQL with deploy/setup --faculty"
  [ -x "$nats" ] || die "nats-server is missing: install it with deploy/setup --faculty"
  # a point in numbers, and texts that sort by their bytes
  export LC_ALL=C.UTF-8
  trap faculty_end EXIT
  trap 'exit 130' INT
  trap 'exit 143' TERM HUP
  faculty_place

  say "PostgreSQL: a primary and its standby"
  faculty_database
  say "NATS"
  faculty_nats

  say "the lab, with its keys and accounts in server a's folder and its data in PostgreSQL"
  local who station trainee exercise i=0
  for who in ada ines; do secret | put "$who.password"; done
  on a --store "postgresql://needlelab@/needlelab?host=$sockets&port=5432" user add ada --role administrator --password-file "$place/ada.password"
  on a user add ines --role instructor --password-file "$place/ines.password"
  while read -r station trainee exercise; do
    on a user add "$trainee" --role trainee
    on a station add "$station" --out "$place/$station.key"
  done < <(faculty_lessons)

  say "two servers on this database"
  server_begins a
  on b server join --from "$place/a" --name b --with-authority
  server_begins b
  at_a=127.0.0.1:$(cat "$place/a.port") at_b=127.0.0.1:$(cat "$place/b.port") ca=$place/a/tls/ca.crt
  echo "  server a $at_a, server b $at_b, live views over $at_nats"

  say "eight stations with simulated hands: four at server a, four at server b"
  while read -r station trainee exercise; do
    i=$((i + 1))
    local servers=$at_a,$at_b
    [ "$i" -le 4 ] || servers=$at_b,$at_a
    begins "$station" "$bin/needlelab-station" --server "$servers" --ca "$ca" --key "$place/$station.key" --trainee "$trainee" \
      --exercise "$exercise" --device simulated --headless --hand-plan target --hand-repeat 0 --hand-seed "$i" --seconds 1800 --drain 60 \
      --spool "$place/spool-$station" --json "$place/results/$station.json"
  done < <(faculty_lessons)
  until_so 60 "all eight stations store" all_store
  local a_name
  a_name=$(sql primary "SELECT server FROM needlelab.station_claims WHERE station = 'station-1'")
  says primary "SELECT count(*) FROM needlelab.station_claims WHERE server = '$a_name' AND server <> 'b' AND station <= 'station-4'" 4 ||
    in_vain "the first four stations are not at server a"
  says primary "SELECT count(*) FROM needlelab.station_claims WHERE server = 'b' AND station > 'station-4'" 4 || in_vain "the other four are not at server b"

  say "ines logs in at server b and watches $watched, which is at server a"
  # each line with the time at which it came
  : >"$out/watch.log"
  "${as[@]}" "$bin/needlelab-instructor" --server "$at_b,$at_a" --ca "$ca" --user ines --password-file "$place/ines.password" --headless --json \
    --station "$watched" --rate 10 > >(while IFS= read -r line; do printf '%s %s\n' "$EPOCHREALTIME" "$line"; done >>"$out/watch.log") \
    2>"$out/watch.err.log" </dev/null &
  running[watch]=$!
  until_so 60 "a picture of $watched reaches server b" frames_since 0
  local word='A little slower, please.' began=$EPOCHREALTIME
  quietly timeout --foreground 60 "${as[@]}" "$bin/needlelab-instructor" --server "$at_b" --ca "$ca" --user ines --password-file "$place/ines.password" --headless \
    --station "$watched" --message "$word" --once --seconds 20
  until_so 60 "$watched hears ines" grep -qF "message from ines: $word" "$out/$watched.log"
  echo "  she says a word to its trainee, who hears it"
  picture lab-before.png 1280x400 3
  until_so 60 "40 pictures of $watched" frames_since "$began" 40
  local frames_before
  frames_before=$(frames)
  echo "  she has seen $frames_before pictures of it so far, ten a second"

  say "kill -9 of server a, in mid-lesson"
  local killed victim=${running[server-a]}
  unset 'running[server-a]'
  killed=$EPOCHREALTIME
  kill -KILL "$victim"
  { wait "$victim" || true; } 2>/dev/null
  until_so 60 "all four stations store at server b" all_moved
  local login again moved_at seen stood
  read -r login again < <(sql primary "SELECT round(max(since_unix_ns / 1e9) - $killed, 2), round(max(extract(epoch FROM again)) - $killed, 2)
    FROM ($moved) AS m") || in_vain "PostgreSQL did not say when what was stored"
  moved_at=$(sql primary "SELECT since_unix_ns / 1e9 FROM needlelab.station_claims WHERE station = '$watched'")
  until_so 60 "a picture of $watched after the kill" frames_since "$moved_at"
  read -r seen stood < <(awk -v killed="$killed" -v moved="$moved_at" '!/"type":"update"/ { next } $1 <= moved { last = $1; next }
    { printf "%.2f %.2f\n", $1 - killed, $1 - last; exit }' "$out/watch.log") || in_vain "watch.log does not say when a picture came"
  sql primary "SELECT '  ' || station || ': at server b after ' || round(since_unix_ns / 1e9 - $killed, 2) || ' s, b stores its session after ' ||
    round(extract(epoch FROM again) - $killed, 2) || ' s' FROM ($moved) AS m ORDER BY station"
  echo "  all stations of server a: at server b after $login s, stored again after $again s"
  echo "  the view at server b: the next picture $seen s after the kill; it stood still for $stood s"
  [ "$(lost_at_b)" = 0 ] || in_vain "stations of server b lost their connection, too"
  echo "  the four stations of server b have noticed nothing"

  say "the lessons continue at server b"
  until_so 60 "50 more pictures" frames_since "$moved_at" 50
  picture look-after.png 1280x800 4 --station "$watched"
  picture lab-after.png 1280x400 3
  for i in 1 2 3 4 5 6 7 8; do lives "station-$i" || in_vain "station-$i has ended by itself; see station-$i.log"; done

  say "the trainees stop; each station delivers what is left in its spool"
  for i in 1 2 3 4 5 6 7 8; do kill -TERM "${running[station-$i]}"; done
  for i in 1 2 3 4 5 6 7 8; do
    local pid=${running[station-$i]}
    unset "running[station-$i]"
    wait "$pid" || in_vain "station-$i ended with a fault; see station-$i.log"
  done
  ends watch || in_vain "the instructor's program ended with a fault; see watch.err.log"

  say "the samples recorded, and those stored"
  local at samples chunks seqs state wrong=no recorded acked said first summary all=0
  printf '  %-10s %-6s %-6s %9s %9s %7s  %s\n' station from to recorded stored chunks session
  while read -r station at samples chunks seqs state; do
    summary=$place/results/$station.json
    recorded=$(field "$summary" samples) acked=$(field "$summary" samples_acked)
    said=$(field "$summary" state) first=b
    [[ $station != station-[1-4] ]] || first=a
    printf '  %-10s %-6s %-6s %9s %9s %7s  %s\n' "$station" "$first" "$at" "$recorded" "$samples" "$chunks" "${said,,}"
    # 2: complete. Chunks from 0 on without a gap; the server compared the whole recording's hash when it closed the session
    if [ "$at $state $samples $acked $chunks $said" != "b 2 $recorded $recorded $seqs COMPLETE" ] || [ "$(field "$summary" samples_lost)" != 0 ] ||
      [ "$(field "$summary" spool_left)" != 0 ]; then
      wrong=yes
    fi
    all=$((all + samples))
  done < <(sql primary "SELECT s.station, k.server, sum(c.samples), count(*), max(c.seq) + 1, s.state FROM needlelab.sessions s
      JOIN needlelab.chunks c ON c.session = s.number JOIN needlelab.station_claims k ON k.station = s.station
    GROUP BY s.station, k.server, s.state, s.number ORDER BY s.station")
  [ "$wrong" = no ] || in_vain "not all that the stations recorded is stored, once"
  says primary "SELECT count(*) FROM needlelab.sessions" 8 || in_vain "there are not eight sessions"
  asks ines session list >"$out/sessions.txt"
  local session
  session=$(field "$place/results/$watched.json" session_id)
  asks ada check >"$out/check.txt" || { cat "$out/check.txt"; in_vain "the database does not check"; }
  sed 's/^/  needlelab-admin check: /' "$out/check.txt"
  local sums='SELECT count(*), sum(samples) FROM needlelab.chunks'
  until_so 60 "the standby has all" says standby "$sums" "$(sql primary "$sums")"
  echo "  the standby has the same: $(sql standby "$sums" | sed 's/ / chunks, /') samples"
  asks ines session export "$session" --every-tick --format csv --out "$place/results/$watched.csv" >/dev/null || in_vain "the session's export failed"
  if command -v gnuplot >/dev/null; then
    local kill_s
    kill_s=$(sql primary "SELECT round($killed - started_unix_ns / 1e9, 2) FROM needlelab.sessions WHERE station = '$watched'")
    # a line at the kill; ten seconds to each side
    awk -F, -v kill="$kill_s" 'NR == 1 { for (i = 1; i <= NF; ++i) if ($i == "t_s") t = i; print; next } $t > kill - 10 && $t < kill + 10' \
      "$place/results/$watched.csv" >"$out/around.csv"
    gnuplot -e "csv='$out/around.csv'; png='$out/over-the-kill.png'; hand='simulated hand, server a killed at the red line'" \
      -e "set arrow 1 from first $kill_s, graph 0 to first $kill_s, graph 1 nohead lw 2 lc rgb 'red'" "$root/deploy/session.gp" >"$out/gnuplot.log" 2>&1 &&
      rm -f "$out/gnuplot.log" || echo "  note: no picture over-the-kill.png (see $out/gnuplot.log)"
    rm -f "$out/around.csv"
  fi

  say "everything ends"
  ends server-b || in_vain "server b did not stop cleanly"
  ends nats || true # it ends with 1 when asked to end
  cluster_stops primary || in_vain "PostgreSQL did not stop"
  faculty_end
  trap - EXIT INT TERM HUP
  say "done: the lesson and the view continued without server a"
  cat <<TEXT
  What was shown
    Two servers worked on one database of PostgreSQL, which answers a COMMIT when its standby has it, too. Eight stations recorded a
    thousand samples a second each. An instructor at server b saw a station at server a and spoke to its trainee, by way of NATS.
    Server a was killed (SIGKILL). Its four stations were at server b after $login s at most, and b stored the same sessions on after $again s;
    until then the stations kept what they recorded in their spools. The instructor's view had its next picture after $seen s.
    The other four noticed nothing. All $all samples that were recorded are stored, each once, at the primary and at the standby.
  What was not shown
    All of it ran on this one machine: nobody pulled a cable, and no two clocks differed. Server a did not come back, and PostgreSQL and NATS went on.
  Look at
    $out
      lab-before.png, lab-after.png     the instructor's overview at server b: which server has which station
      look-after.png                    her view of $watched after the kill
      over-the-kill.png, $watched.csv   its recording: no gap where server a was killed
      watch.log                         each line that she saw, with the time at which it came; the kill was at $killed
      sessions.txt, check.txt, *.json   what is stored; what each station says
      server-a.log, server-b.log, station-*.log, primary.log, standby.log, nats.log
    Nothing runs any more; database and keys of this demo are removed.
  Your own: deploy/FACULTY.md, "A database on PostgreSQL"; configuration and units in deploy/faculty.
TEXT
}
