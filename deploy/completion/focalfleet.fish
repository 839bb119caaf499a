# This file is installed as /usr/share/fish/vendor_completions.d/focalfleet.fish, where fish looks for it at the first tab.
# The program writes its own completion, so this file is never outdated.
if command -q focalfleet
    focalfleet completion fish | source
end
