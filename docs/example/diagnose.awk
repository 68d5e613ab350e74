# A diagnosis of three rules, to show the form of the answers of the gap benchmark: awk -f diagnose.awk DIR/records/*.csv
# prints id,effect,probability. Beside each record r.csv lies r.toml, the simulation that lacks something.

BEGIN { FS = ","; print "id,effect,probability" }

FNR == 1 {                                   # a new record: answer the last one, read the baseline of this one
    if (NR > 1) answer()
    split("", column); for (i = 1; i <= NF; i++) column[$i] = i
    n = still = moved = stuck = sum = 0
    id = FILENAME; sub(/.*\//, "", id); sub(/\.csv$/, "", id)
    baseline = FILENAME; sub(/\.csv$/, ".toml", baseline); std = section = 0
    while ((getline line < baseline) > 0) {
        if (line ~ /^\[/) section = line
        if (section == "[noise]" && line ~ /^std/) { sub(/.*= */, "", line); std = line + 0 }
    }
    close(baseline)
    next
}

{
    op = $column["op"]; pv = $column["pv"]; mv = ("mv" in column) ? $column["mv"] : ""
    if (n >= 2) { d = pv - 2 * pv1 + pv2; sum += d * d; still += (pv == pv1) }
    if (n >= 1 && op != op1) { moved++; stuck += (mv != "" && mv == mv1) }
    pv2 = pv1; pv1 = pv; op1 = op; mv1 = mv; n++
}

END { answer() }

function answer(   noise) {
    noise = n > 2 ? sqrt(sum / (6 * (n - 2))) : 0      # of white noise, from second differences
    if (moved > 0 && stuck / moved > 0.5) { print id ",stiction,0.7"; print id ",deadband,0.2" }
    else if (n > 2 && still / n > 0.2) { print id ",quantisation,0.5"; print id ",compression,0.3" }
    else if (std > 0 && noise > 1.3 * std) print id ",noise,0.6"
    else { print id ",none,0.5"; print id ",unknown,0.3" }
}
