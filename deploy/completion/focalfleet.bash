# This file is installed as /usr/share/bash-completion/completions/focalfleet, where bash-completion looks for it at the
# first tab. The program writes its own completion, so this file is never outdated.
if command -v focalfleet >/dev/null 2>&1; then
  eval "$(focalfleet completion bash)"
fi
