"""A page to explore a scene: sliders, the forced response that follows them, and the motion at a point of it.

controls      what can be moved in a scene, and the scene with its values moved
curves        a forced response under way in worker processes: coarse first, then fine, cancelled when it is not wanted
chart         its picture and its key results
page          the page: its parts, and their callbacks
point         the motion at a point of the curve that was clicked; point_view: its run, drawn
sweep_files   sweeps from files, moved through by their axes; sweep_chart: their curves, and the best design
server        the address that the page has, for this machine and this browser only
"""
