// SPDX-License-Identifier: Apache-2.0
// How the page's JavaScript is checked: `npx eslint@9 billiards_sim/play/page`, in .ci/run where npm is there.

const BROWSER = [
  "Blob", "CSS", "Image", "ResizeObserver", "TextDecoder", "TextEncoder", "URL", "WebSocket", "atob", "btoa",
  "clearTimeout", "document", "history", "location", "navigator", "performance", "requestAnimationFrame",
  "setTimeout", "window",
];

export default [
  {
    files: ["billiards_sim/play/page/*.js"],
    languageOptions: {
      ecmaVersion: 2023,
      sourceType: "module",
      globals: Object.fromEntries(BROWSER.map((name) => [name, "readonly"])),
    },
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules: {
      "array-callback-return": "error",
      "consistent-return": "error",
      "default-case-last": "error",
      eqeqeq: "error",
      "max-len": ["error", { code: 120 }],
      "no-const-assign": "error",
      "no-dupe-keys": "error",
      "no-eval": "error",
      "no-implicit-globals": "error",
      "no-import-assign": "error",
      "no-param-reassign": "error",
      "no-redeclare": "error",
      "no-shadow": "error",
      "no-undef": "error",
      "no-unreachable": "error",
      "no-unused-vars": "error",
      "no-use-before-define": ["error", { functions: false, classes: false, variables: false }],
      "no-var": "error",
      "prefer-const": "error",
    },
  },
];
