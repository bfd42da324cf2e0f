import { defineConfig } from "vite";

// `npm run dev` serves the page from Vite and talks to a console that already runs.
export default defineConfig({
  build: { outDir: "dist", emptyOutDir: true, target: "es2022" },
  server: { proxy: { "/ws": { target: "ws://localhost:8080", ws: true } } },
});
