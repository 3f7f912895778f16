"""One class drives a rig from Python: a campaign that goes on until k is known well enough."""

from impact_rig.testing import run_rig

with run_rig(seed=7) as rig:
    for impacts in (2, 4, 8):
        results = rig.campaign(["steel small", "aluminium large"], impacts)
        k = results["steel small"].stiffness
        print(f"{impacts} hits: k = {k}")
        if k.expanded < 0.02 * k.value:
            break
