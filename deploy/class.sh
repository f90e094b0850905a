# deploy/demo --class: a lab with twelve simulated trainees to explore; sourced by deploy/demo.
# shellcheck shell=bash
# Needs bin, root, once, small. Skill only sets how a simulated hand moves: every score is the server's.
# NEEDLELAB_CLASS_COURSE: bodies (default) or injection-steps, whose phantoms tests/numbers computes by itself.

# name, full name, skill, group, consent to studies
class_people() {
  cat <<'TABLE'
anna|Anna Keller|0.00|year-1|yes
ben|Ben Okafor|0.08|year-1|yes
chloe|Chloé Martin|0.16|year-1|no
david|David Nowak|0.24|year-1|yes
elif|Elif Demir|0.32|year-1|yes
farid|Farid Haddad|0.40|year-1|no
greta|Greta Lindqvist|0.60|year-5|yes
hugo|Hugo Fernandes|0.68|year-5|yes
ida|Ida Rossi|0.76|year-5|yes
jonas|Jonas Weber|0.84|year-5|no
kira|Kira Petrova|0.92|year-5|yes
liam|Liam Byrne|1.00|year-5|yes
TABLE
}

class_password() { head -c 12 /dev/urandom | base64 | tr '+/' 'xy'; }

# asks PERSON ARGUMENT …: runs needlelab-admin on the running server as that person
asks() {
  local who=$1; shift
  "$bin/needlelab-admin" "${peer[@]}" --user "$who" --password-file "$out/$who.password" "$@"
}

# quietly COMMAND …: prints its output only if it fails
quietly() {
  local words
  words=$("$@" 2>&1) || { printf '%s\n' "$words" >&2; die "failed: $*"; }
}

# practises STATION TRAINEE SKILL EXERCISE …: runs real lessons in real time, one after the other, until it is stopped
practises() {
  local station=$1 trainee=$2 skill=$3 child='' exercise
  shift 3
  trap '' INT  # Ctrl+C in a terminal reaches all processes; this one is ended by TERM, while the server is still there
  trap '[ -z "$child" ] || { kill "$child" 2>/dev/null || true; wait "$child" || true; }; exit 0' TERM
  while :; do
    for exercise; do
      "$bin/needlelab-station" "${peer[@]}" --key "$out/$station.key" --trainee "$trainee" --exercise "$exercise" \
        --device simulated --hand-skill "$skill" --hand-seed "$RANDOM" --headless --spool "$out/spool-$station" \
        >>"$out/$station.log" 2>&1 &
      child=$!
      wait "$child" || sleep 5
      child=
      sleep 2
    done
  done
}

# the processes beside this script: trainees first, then the server, which must not get Ctrl+C itself (setsid)
server_pid='' live=()
class_stop() {
  local pid
  for pid in "${live[@]}"; do kill "$pid" 2>/dev/null || true; done
  for pid in "${live[@]}"; do wait "$pid" 2>/dev/null || true; done
  live=()
  [ -n "$server_pid" ] || return 0
  kill -TERM "$server_pid" 2>/dev/null || true
  wait "$server_pid" || { server_pid=; return 1; }
  server_pid=
}

class_demo() {
  local course=${NEEDLELAB_CLASS_COURSE:-bodies} stations=3 attempts=2 expert_attempts=2 weeks=4 samples=$root/db/samples exercises profiles
  case $course in
    bodies)
      samples+=/volumes exercises=(shoulder-median wrist-median knee-median lumbar-median)
      profiles=("${exercises[@]}") ;;
    injection-steps)
      exercises=(step-1-straight step-5-small step-3-capsule step-2-oblique step-4-deep step-6-beside-a-nerve)
      attempts=3 expert_attempts=6
      profiles=(deltoid-adult shoulder-posterior knee-adult hip-adult finger-adult carpal-tunnel) ;;
    *) die "NEEDLELAB_CLASS_COURSE is '$course', allowed is bodies or injection-steps" ;;
  esac
  local people; people=$(class_people)
  if [ "$small" = yes ]; then
    people=$(grep -E '^(anna|elif|ida|liam)\|' <<<"$people")
    exercises=("${exercises[@]:0:2}") stations=2 attempts=2 expert_attempts=2 weeks=2
  fi

  out=${NEEDLELAB_CLASS_OUT:-$root/out/class}/$(date +%Y%m%d-%H%M%S)-$$
  mkdir -p "$out"; chmod 700 "$out"
  local data=$out/server i
  trap class_stop EXIT

  say "people, groups, stations"
  local name full skill group consent
  { echo "name,full_name,role,group,password"
    while IFS='|' read -r name full skill group consent; do
      class_password >"$out/$name.password"
      echo "$name,$full,trainee,$group,$(cat "$out/$name.password")"
    done <<<"$people"
    for name in maria:manager:"Maria Sørensen" ines:instructor:"Ines Dubois" ivan:instructor:"Ivan Horvat"; do
      IFS=: read -r who role full <<<"$name"
      class_password >"$out/$who.password"
      echo "$who,$full,$role,staff,$(cat "$out/$who.password")"
    done
  } >"$out/people.csv"
  for name in admin rosa; do class_password >"$out/$name.password"; done
  chmod 600 "$out"/*.password "$out/people.csv"
  quietly "$bin/needlelab-admin" --data "$data" user add admin --role administrator --password-file "$out/admin.password"
  quietly "$bin/needlelab-admin" --data "$data" user add rosa --role researcher --password-file "$out/rosa.password"
  quietly "$bin/needlelab-admin" --data "$data" user import "$out/people.csv"
  rm "$out/people.csv"
  for i in $(seq $((stations + 3))); do
    quietly "$bin/needlelab-admin" --data "$data" station add "lab-$i" --out "$out/lab-$i.key"
  done

  # the console's usual port, if it is free
  local web=127.0.0.1:7751
  if [ "$once" = yes ] || (exec 3<>/dev/tcp/127.0.0.1/7751) 2>/dev/null; then web=127.0.0.1:0; fi
  setsid "$bin/needlelab-server" --data "$data" --listen 127.0.0.1:0 --port-file "$out/port" --web "$web" --web-port-file "$out/web-port" \
    --web-root "$root/client/web" >"$out/server.log" 2>&1 &
  server_pid=$!
  for _ in $(seq 1200); do
    [ -s "$out/port" ] && [ -s "$out/web-port" ] && break
    kill -0 "$server_pid" 2>/dev/null || break
    sleep 0.1
  done
  [ -s "$out/port" ] && [ -s "$out/web-port" ] || { cat "$out/server.log"; die "the server did not start"; }
  peer=(--server "127.0.0.1:$(cat "$out/port")" --ca "$data/tls/ca.crt")

  say "assignments, by the manager: the course $course to both years, ${exercises[1]} to year 1 until last week"
  quietly asks maria assign --group year-1 --course $course --due "$(date -u -d '+14 days' +%Y-%m-%dT18:00Z)"
  quietly asks maria assign --group year-5 --course $course --due "$(date -u -d '+7 days' +%Y-%m-%dT18:00Z)"
  quietly asks maria assign --group year-1 --exercise "${exercises[1]}" --due "$(date -u -d '-7 days' +%Y-%m-%dT18:00Z)"
  while IFS='|' read -r name full skill group consent; do
    [ "$consent" = no ] || quietly asks maria consent give "$name"
  done <<<"$people"

  # experts first: the others are compared with them
  local keys=() experts=() others=()
  for i in $(seq "$stations"); do keys+=(--key "$out/lab-$i.key"); done
  while IFS='|' read -r name full skill group consent; do
    case $skill in 0.9* | 1*) experts+=(--trainee "$name=$skill") ;; *) others+=(--trainee "$name=$skill") ;; esac
  done <<<"$people"
  local lessons=() e
  for e in "${exercises[@]}"; do lessons+=(--exercise "$e"); done
  say "experts practise: simulated hands, faster than real time, dated over the last $weeks weeks"
  "$bin/needlelab-class" "${peer[@]}" "${keys[@]}" "${experts[@]}" "${lessons[@]}" --attempts "$expert_attempts" --weeks "$weeks" \
    --seed 1 --spool "$out/spool" --out "$out/experts.csv" || die "the experts' sessions failed; see above and $out/server.log"
  say "their passed sessions become each exercise's reference, but for those in which a hazard or bone was touched"
  quietly asks ines scores export --out "$out/experts-scores.csv"
  awk -F, 'NR == FNR { if (($7 == "hazards_touched" || $7 == "bone_contacts") && $8 > 0) touched[$1] = 1; next }
    $9 == 1 && !touched[$1]' "$out/experts-scores.csv" "$out/experts.csv" >"$out/references.csv"
  for e in "${exercises[@]}"; do
    local chosen
    mapfile -t chosen < <(awk -F, -v e="$e" '$3 == e {print $1}' "$out/references.csv")
    [ "${#chosen[@]}" -gt 0 ] || { echo "  $e: no expert passed without touching a hazard or bone, so it has no reference"; continue; }
    asks ines reference set "$e" "${chosen[@]}"
  done
  say "the others practise"
  "$bin/needlelab-class" "${peer[@]}" "${keys[@]}" "${others[@]}" "${lessons[@]}" --attempts "$attempts" --weeks "$weeks" \
    --seed 2 --spool "$out/spool" --out "$out/others.csv" || die "the others' sessions failed; see above and $out/server.log"

  say "remarks by the instructors, an attempt that does not count, a backup"
  local session
  while IFS=, read -r session name; do
    quietly asks ines annotate "$session" --tick 4000 --text "Not passed. Let us look at the requirements together, $name, before the next attempt."
  done < <(awk -F, '$9 == 0 && $4 == 1 && !seen[$2]++ {print $1 "," $2}' "$out/others.csv" | head -6)
  while IFS=, read -r session name; do
    quietly asks ivan annotate "$session" --tick 2000 --text "Passed, and chosen as a reference for the others."
  done < <(awk -F, '!seen[$3]++ {print $1 "," $2}' "$out/references.csv" | head -3)
  session=$(awk -F, '$9 == 0 && $4 == 2 {print $1; exit}' "$out/others.csv")
  [ -z "$session" ] || quietly asks maria excuse "$session" --reason "the table was knocked against"
  quietly asks admin backup "$out/backup.db"

  say "checks"
  local stored wanted
  wanted=$(cat "$out/experts.csv" "$out/others.csv" | awk -F, '$8 == 1' | wc -l)
  stored=$(asks ines scores export --out "$out/scores.csv" | sed -n 's/^\([0-9]*\) scores.*/\1/p')
  [ "$stored" = "$wanted" ] || die "$wanted sessions were closed, ${stored:-no} scores are stored"
  asks admin check >"$out/check.log" || { cat "$out/check.log"; die "the database does not check"; }
  # the server returns exactly what the repository has
  quietly asks maria curriculum export "$course" --out "$out/course.json"
  cmp "$out/course.json" "$samples/$course-curriculum.json" || die "the course came back changed"
  for name in "${profiles[@]}"; do
    quietly asks maria profile export "$name" --out "$out/profile.json"
    cmp "$out/profile.json" "$samples/$name.json" || die "profile $name came back changed"
    rm "$out/profile.json"
  done
  if command -v curl >/dev/null; then
    curl -sSf --cacert "$data/tls/ca.crt" -o "$out/page.html" "https://127.0.0.1:$(cat "$out/web-port")/" || die "the web console does not answer"
    grep -qi '<html' "$out/page.html" || die "the web console answered with something else than a page; see $out/page.html"
  fi
  asks ines results "$course"
  echo "  $stored sessions with scores; $(cat "$out/check.log" | tail -1)"

  say "three trainees practise live"
  local last; last=$(tail -1 <<<"$people" | cut -d'|' -f1)
  practises "lab-$((stations + 1))" anna 0.1 "${exercises[@]:0:2}" & live+=($!)
  if [ "$small" = no ]; then
    practises "lab-$((stations + 2))" farid 0.5 "${exercises[2]}" "${exercises[0]}" & live+=($!)
    practises "lab-$((stations + 3))" "$last" 1 "${exercises[3]}" "${exercises[1]}" & live+=($!)
  fi
  "$bin/needlelab-instructor" "${peer[@]}" --user ines --password-file "$out/ines.password" --headless --json --seconds 8 \
    >"$out/live.log" 2>&1 || { tail -5 "$out/live.log"; die "the live overview failed"; }
  grep -q "lab-$((stations + 1))" "$out/live.log" || { tail -5 "$out/live.log"; die "no trainee is seen live"; }

  say "done"
  cat <<TEXT
  web console   https://127.0.0.1:$(cat "$out/web-port")/
                (its certificate is of this lab's own authority, $data/tls/ca.crt: import that, or accept the warning)
  log in as
TEXT
  for name in maria:manager ines:instructor ivan:instructor rosa:researcher admin:administrator anna:trainee "$last:trainee"; do
    printf '    %-8s %-18s %s\n' "${name%%:*}" "$(cat "$out/${name%%:*}.password")" "${name##*:}"
  done
  cat <<TEXT
    (all others: $out/NAME.password)
  sessions      $out/experts.csv, $out/others.csv, $out/scores.csv
  These are simulated hands: a check of the machinery, no evidence about people. Skill set tremor, speed, aim, overshoot
  and smoothness; dates lie in the past because the stations said so, as one does that was offline.
TEXT
  if [ "$once" = no ]; then
    echo "  The lab runs until Ctrl+C."
    # a signal can end `wait` while the server still runs
    local told=no
    trap 'told=yes' INT TERM
    while [ "$told" = no ] && kill -0 "$server_pid" 2>/dev/null; do wait "$server_pid" || true; done
    [ "$told" = yes ] || { server_pid=; die "the server ended; see $out/server.log"; }
  fi
  class_stop || die "the server did not stop cleanly; see $out/server.log"
  trap - EXIT
}
