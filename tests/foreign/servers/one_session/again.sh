# One process for each session, as a batch system starts them.
trap 'kill "$child" 2>/dev/null; exit 0' TERM INT HUP
while :; do
    node "$(dirname "$0")/server.js" &
    child=$!
    wait "$child"
done
