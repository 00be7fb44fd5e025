// SPDX-License-Identifier: MIT
// A stub of what Unreal's build tool gives to a module's rules: ours, without a line of Unreal's, made from
// what the rules use. `rules PLUGIN RENDERER`: the folders of both; it prints where headers are looked for.
using System;
using System.Collections.Generic;

namespace UnrealBuildTool
{
	public enum PCHUsageMode { UseExplicitOrSharedPCHs }
	public enum CppStandardVersion { Cpp20 }
	public enum UnrealTargetPlatform { Linux, Win64 }
	public class ReadOnlyTargetRules { public UnrealTargetPlatform Platform; }

	public class ModuleRules
	{
		public static string Plugin, Renderer;
		public PCHUsageMode PCHUsage;
		public CppStandardVersion CppStandard;
		public bool bEnableExceptions = true, bUseRTTI = true;
		public List<string> PublicDependencyModuleNames = new List<string>(), PrivateDependencyModuleNames = new List<string>();
		public List<string> PrivateIncludePaths = new List<string>(), PublicSystemLibraries = new List<string>();
		public string PluginDirectory { get { return Plugin; } }
		public ModuleRules(ReadOnlyTargetRules target) { }
		public string GetModuleDirectory(string name) { return name == "Renderer" ? Renderer : null; }
	}
}

static class Rules
{
	static void Main(string[] arguments)
	{
		UnrealBuildTool.ModuleRules.Plugin = arguments[0];
		UnrealBuildTool.ModuleRules.Renderer = arguments[1];
		var rules = new SplatBus(new UnrealBuildTool.ReadOnlyTargetRules());
		foreach (string each in rules.PrivateIncludePaths) Console.WriteLine(each);
	}
}
