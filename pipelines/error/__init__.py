"""What a run's numbers are worth: estimate, certificate, verification, error of the mesh, study, and
comparison.

Every statement of error compares two runs of one job that differ in one thing: the modes, the steps, the mesh
or the contact points. The modules here build the other run and execute both. `romdam.error` computes the
differences.
"""
