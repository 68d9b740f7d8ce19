"""How a report looks."""

CSS = """
:root { --ink: #1b1f24; --faint: #5b6570; --line: #d5dae0; --back: #f5f7f9;
  --card: #ffffff; --mark: #0072b2; --warn: #d55e00; }
* { box-sizing: border-box; }
html { scroll-behavior: smooth; }
body { margin: 0; color: var(--ink); background: var(--back); line-height: 1.5;
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans",
  sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 28px 20px 60px; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0 0 4px; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 0 0 10px; }
h3 { font-size: .95rem; margin: 18px 0 6px; }
p { margin: 6px 0; max-width: 78ch; }
a { color: var(--mark); }
.faint { color: var(--faint); }
.small { font-size: .86rem; }
.summary { font-size: 1.12rem; max-width: 85ch; margin: 14px 0 18px; }
section { background: var(--card); border: 1px solid var(--line); border-radius: 10px;
  padding: 18px 20px; margin: 16px 0; }
.tiles { display: grid; gap: 12px; margin: 16px 0;
  grid-template-columns: repeat(auto-fit, minmax(132px, 1fr)); }
.tile { background: var(--card); border: 1px solid var(--line); border-radius: 10px;
  padding: 12px 14px; }
.tile b { display: block; font-size: 1.45rem; line-height: 1.2;
  font-variant-numeric: tabular-nums; }
.tile span { color: var(--faint); font-size: .85rem; display: block; }
.tile.bad { border-left: 5px solid var(--warn); }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; }
th { text-align: left; font-weight: 600; color: var(--faint); white-space: nowrap;
  border-bottom: 2px solid var(--line); padding: 5px 10px 5px 0;
  vertical-align: bottom; }
td { border-bottom: 1px solid var(--line); padding: 6px 10px 6px 0;
  vertical-align: top; overflow-wrap: anywhere; }
td.n, th.n { text-align: right; white-space: nowrap; overflow-wrap: normal;
  font-variant-numeric: tabular-nums; }
td.n + td:not(.n), th.n + th:not(.n) { padding-left: 14px; }
td.t { white-space: nowrap; font-variant-numeric: tabular-nums; }
tr:target td { background: #eaf4fb; }
.chip { display: inline-block; border-radius: 4px; padding: 1px 7px; font-size: .8rem;
  font-weight: 600; white-space: nowrap; border: 1px solid rgba(0,0,0,.15); }
.miss { border-top: 1px solid var(--line); padding: 12px 0; }
.miss:first-of-type { border-top: 0; }
.miss:target { background: #eaf4fb; }
.small-plot { width: 100%; max-width: 760px; height: auto; font-size: 11px; }
.key i { display: inline-block; width: 22px; height: 0; margin: 0 5px 3px 14px;
  border-top: 3px solid; vertical-align: middle; }
.note { border-left: 4px solid var(--warn); padding: 4px 12px; background: #fdf3ec; }
.plot { width: 100%; overflow: hidden; }
code { font-size: .88em; overflow-wrap: anywhere; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 3px 18px;
  margin: 6px 0; font-size: .92rem; }
dt { color: var(--faint); }
dd { margin: 0; overflow-wrap: anywhere; }
nav { font-size: .9rem; margin: 8px 0 0; }
nav a { margin-right: 14px; white-space: nowrap; }
details > summary { cursor: pointer; color: var(--mark); }
@media (max-width: 700px) { main { padding: 16px 10px 40px; }
  section { padding: 14px 12px; } dl { grid-template-columns: 1fr; } }
@media print { body { background: #fff; } section, .tile { break-inside: avoid; } }
"""
