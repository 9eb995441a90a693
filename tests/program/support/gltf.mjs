// Validates GLB files with Khronos' validator and prints the errors and warnings of all of them as JSON.
//
//     node gltf.mjs NODE_MODULES FILE…

import { createRequire } from "node:module";
import { readFile } from "node:fs/promises";
import { join } from "node:path";

const [modules, ...files] = process.argv.slice(2);
const validator = createRequire(join(modules, "here.js"))("gltf-validator");
const WARNING = 1;
const found = [];
for (const file of files) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(file)), { uri: file });
  const issues = report.issues.messages.filter((message) => message.severity <= WARNING);
  found.push(...issues.map((message) => `${file}: ${message.code} ${message.message}`));
}
console.log(JSON.stringify(found));
