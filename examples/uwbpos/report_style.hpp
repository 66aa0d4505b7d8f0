// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// How report.html looks: light, dark, narrow and on paper.

#include <string_view>

namespace uwbpos::host {

inline constexpr std::string_view kReportStyle = R"css(
:root {
  color-scheme: light dark;
  --page: #f6f7f9; --card: #ffffff; --line: #e2e5ea;
  --text: #1b2430; --muted: #5f6b7a; --grid: #e6e9ee; --truth: #8a95a3; --anchor: #1b2430;
  --mark: #b45309; --worst: #dc2626; --accent: #2563eb;
  --series-0: #2563eb; --series-1: #d97706; --series-2: #059669;
  --series-3: #c026d3; --series-4: #0891b2; --series-5: #7c5c3b;
}
@media (prefers-color-scheme: dark) {
  :root {
    --page: #10151c; --card: #18202a; --line: #2a3542;
    --text: #e6ebf2; --muted: #9aa7b6; --grid: #283341; --truth: #8794a5; --anchor: #e6ebf2;
    --mark: #fbbf24; --worst: #f87171; --accent: #7aa7ff;
    --series-0: #6ea0ff; --series-1: #f5a742; --series-2: #34d399;
    --series-3: #e879f9; --series-4: #38cfe8; --series-5: #c9a27a;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--page); color: var(--text);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif;
}
main { max-width: 1120px; margin: 0 auto; padding: 28px 20px 48px; }
h1 { font-size: 1.55rem; line-height: 1.25; margin: 0 0 4px; overflow-wrap: anywhere; }
h2 { font-size: 1.05rem; margin: 0 0 8px; }
p { margin: 0 0 8px; }
.lead { color: var(--muted); margin-bottom: 20px; }
.numbers { display: grid; grid-template-columns: repeat(auto-fit, minmax(132px, 1fr)); gap: 12px;
  margin: 0 0 16px; }
.number, .card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; }
.numbers.two-rows { grid-template-columns: repeat(4, minmax(0, 1fr)); }
.number { padding: 12px 14px; min-width: 0; }
.number b { display: block; font-size: 1.45rem; line-height: 1.2; font-weight: 650;
  font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
.number span { color: var(--muted); font-size: 0.86rem; }
.number.first { border-color: var(--accent); }
.number.first b { color: var(--accent); }
.grid { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 16px;
  align-items: start; }
.card { padding: 16px; margin: 0; min-width: 0; }
.wide { grid-column: 1 / -1; }
.column { display: flex; flex-direction: column; gap: 16px; min-width: 0; }
code { font-size: 0.92em; background: var(--page); border-radius: 4px; padding: 1px 4px; }
figure svg { display: block; width: 100%; height: auto; }
figcaption, .note { color: var(--muted); font-size: 0.86rem; margin-top: 6px; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { padding: 5px 10px 5px 0; text-align: right; border-bottom: 1px solid var(--line);
  white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
th { color: var(--muted); font-weight: 500; font-size: 0.86rem; }
tr:last-child td { border-bottom: 0; }
td.words { white-space: normal; text-align: left; }
.verdict { font-size: 1.06rem; }
.missing { color: var(--mark); }
ul { margin: 0; padding-left: 1.1em; }
li { overflow-wrap: anywhere; }
footer { color: var(--muted); font-size: 0.86rem; margin-top: 20px; }
@media (max-width: 720px) {
  main { padding: 16px 12px 32px; }
  .grid { display: flex; flex-direction: column; align-items: stretch; gap: 12px; }
  .column { display: contents; }
  .later { order: 1; }
  .numbers, .numbers.two-rows { grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 8px; }
  .card { padding: 12px; }
  h1 { font-size: 1.3rem; }
  table { font-size: 0.8rem; }
  th { font-size: 0.75rem; }
  th, td { padding-right: 6px; }
}
@media print {
  :root {
    color-scheme: light;
    --page: #ffffff; --card: #ffffff; --line: #c9ced6;
    --text: #000000; --muted: #444c57; --grid: #dde1e7; --truth: #77808c; --anchor: #000000;
    --mark: #92400e; --worst: #b91c1c; --accent: #1d4ed8;
    --series-0: #1d4ed8; --series-1: #b45309; --series-2: #047857;
    --series-3: #a21caf; --series-4: #0e7490; --series-5: #6b4a2b;
  }
  @page { margin: 14mm; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  body { font-size: 9.5pt; }
  .verdict { font-size: 1em; }
  table { font-size: 8pt; }
  th { font-size: 7.5pt; }
  th, td { padding: 3px 5px 3px 0; }
  .scroll { overflow: visible; }
  footer { margin-top: 8px; }
  main { max-width: none; padding: 0; }
  .grid { grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 10px; }
  .numbers { grid-template-columns: repeat(4, minmax(0, 1fr)); gap: 8px; }
  .column { gap: 10px; }
  .card, .number { break-inside: avoid; }
  .card { padding: 10px; }
  .number { padding: 8px 10px; }
}
)css";

}  // namespace uwbpos::host
