# What bash reads first in `rig.py shell`: the user's own start-up file, which may put its Python
# (pyenv, conda, asdf, mise) before everything else, and then what the rig needs, before that.
[ ! -f ~/.bashrc ] || . ~/.bashrc
. "$(dirname "${BASH_SOURCE[0]}")/../install/impact_rig/environment.sh"
