# Progress of long work, read from its output: on a terminal a bar with the time left, else a line per 10 %.
# ./livemap reads this file before it installs or builds.

# show_share PERCENT SECONDS_SO_FAR: shows the share of $progress_of that is done, on standard error.
show_share() {
  local percent=$1 so_far=$2 left=
  # The first few steps say little of those to come.
  if ((percent >= 5 && percent < 100 && so_far >= 5)); then
    left=", $(in_words $((so_far * (100 - percent) / percent))) left"
  fi
  if [[ -t 2 ]]; then
    local done_part=$((percent * 30 / 100)) bar
    printf -v bar '%*s' "$done_part" ''
    printf '\rlivemap: %s [%-30s] %3d %%%s\e[K' "$progress_of" "${bar// /#}" "$percent" "$left" >&2
  elif ((percent / 10 > progress_tenths)); then
    progress_tenths=$((percent / 10))
    printf 'livemap: %s, %d %% done%s\n' "$progress_of" $((progress_tenths * 10)) "$left" >&2
  fi
}

in_words() {
  local seconds=$1
  if ((seconds < 60)); then echo "less than a minute"; else echo "about $(((seconds + 30) / 60)) min"; fi
}

# Ends the bar, so that what is printed next starts on a line of its own.
end_progress() { [[ ! -t 2 ]] || printf '\r\e[K' >&2; }

# show_build_progress COMMAND...: reads ninja's output. COMMAND prints the steps that are still to be done.
#
# A step that compiles takes from seconds to a minute, any other a moment: those that compile are counted.
show_build_progress() {
  progress_of=building progress_tenths=0
  local line= part status begin=0 compiled=0 to_compile=0 percent=0
  while true; do
    IFS= read -t 1 -r part && status=0 || status=$?
    line+=$part
    # More than 128: nothing was printed for a second, and the bar's time goes on.
    if ((status > 128)); then
      ((begin == 0)) || show_share "$percent" $((SECONDS - begin))
      continue
    fi
    ((status == 0)) || break
    case $line in
      # The steps are known after these.
      *"] Re-checking globbed"* | *"] Re-running CMake"*) ;;
      \[*/*\]*)
        if ((begin == 0)); then
          begin=$SECONDS
          to_compile=$("$@" 2>/dev/null | grep -c '\] Building CXX' || true)
        fi
        [[ $line != *"] Building CXX"* ]] || compiled=$((compiled + 1))
        if ((to_compile > 0)); then
          percent=$((compiled * 100 / (compiled > to_compile ? compiled : to_compile)))
          show_share "$percent" $((SECONDS - begin))
        fi ;;
      FAILED:* | *" error: "* | *"CMake Error"*) end_progress; printf '%s\n' "$line" >&2 ;;
    esac
    line=
  done
  end_progress
}

# show_install_progress: reads the output of apt-get with APT::Status-Fd=1, whose status lines say how much
# of the downloads (dlstatus) and then how much of the installation (pmstatus) is done.
show_install_progress() {
  progress_of=downloading progress_tenths=0
  local kind percent begin=$SECONDS
  while IFS=: read -r kind _ percent _; do
    [[ $kind == dlstatus || $kind == pmstatus ]] || continue
    if [[ $kind == pmstatus && $progress_of == downloading ]]; then
      progress_of=installing progress_tenths=0 begin=$SECONDS
    fi
    show_share "${percent%%.*}" $((SECONDS - begin))
  done
  end_progress
}
