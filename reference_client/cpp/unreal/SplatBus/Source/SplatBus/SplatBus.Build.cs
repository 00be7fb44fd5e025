// SPDX-License-Identifier: MIT
using System.IO;
using UnrealBuildTool;

public class SplatBus : ModuleRules
{
	public SplatBus(ReadOnlyTargetRules Target) : base(Target)
	{
		PCHUsage = PCHUsageMode.UseExplicitOrSharedPCHs;
		CppStandard = CppStandardVersion.Cpp20;
		bEnableExceptions = false;
		bUseRTTI = false;

		PublicDependencyModuleNames.AddRange(new string[] { "Core", "CoreUObject", "DeveloperSettings", "Engine" });
		PrivateDependencyModuleNames.AddRange(new string[] { "Projects", "RenderCore", "Renderer", "RHI" });

		// The headers of the client: those that were copied beside Source, or those of the repository that this lies in.
		string Copied = Path.GetFullPath(Path.Combine(PluginDirectory, "ThirdParty", "splatbus", "include"));
		string Beside = Path.GetFullPath(Path.Combine(PluginDirectory, "..", "..", "include"));
		string Client = Directory.Exists(Copied) ? Copied : Beside;
		if (!File.Exists(Path.Combine(Client, "splatbus", "client.hpp")))
		{
			throw new FileNotFoundException("SplatBus: copy reference_client/cpp/include of the SplatBus repository to " + Copied);
		}
		PrivateIncludePaths.Add(Client);

		// FPostProcessingInputs is in neither of the Renderer's public headers; which folder has it hangs on the version.
		foreach (string Folder in new string[] { "Internal", "Private" })
		{
			string Headers = Path.Combine(GetModuleDirectory("Renderer"), Folder);
			if (Directory.Exists(Headers))
			{
				PrivateIncludePaths.Add(Headers);
			}
		}

		if (Target.Platform == UnrealTargetPlatform.Win64)
		{
			PublicSystemLibraries.Add("ws2_32.lib");
		}
	}
}
